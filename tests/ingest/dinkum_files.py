"""Slocum files made for tests: headers, sensor lists and records written out byte by byte."""

import struct
from pathlib import Path

#: The record with known values behind every header: tag, cycle number, 0x1234, 123.456, 123456789.12345.
KNOWN = b"sa" + struct.pack("<Hfd", 0x1234, 123.456, 123456789.12345)
_CODES = {1: "b", 2: "h", 4: "f", 8: "d"}

FLIGHT = {
    "m_present_time": 8,
    "m_pitch": 4,
    "m_roll": 4,
    "m_heading": 4,
    "m_gps_mag_var": 4,
    "m_pressure": 4,
    "m_de_oil_vol": 4,
    "m_ballast_pumped": 4,
    "m_battpos": 4,
    "m_thruster_power": 4,
    "m_battery": 4,
    "m_gps_lat": 8,
    "m_gps_lon": 8,
    "m_gps_status": 1,
}
SCIENCE = {
    "sci_m_present_time": 8,
    "sci_water_pressure": 4,
    "sci_water_temp": 4,
    "sci_water_cond": 4,
    "sci_ctd41cp_timestamp": 8,
}


def sensor_list(sensors: dict[str, int]) -> bytes:
    """Return the list of sensors as it stands in a file or in a cache file."""
    lines = (f"s: T {index:4d} {index:4d} {size} {name} unit\n" for index, (name, size) in enumerate(sensors.items()))
    return "".join(lines).encode()


def header(sensors: dict[str, int], *, cache: str = "", version: int = 5) -> bytes:
    """Return the header of a file; its list of sensors is in the cache file `cache`, if one is named."""
    tags = {
        "dbd_label": "DBD(dinkum_binary_data)file",
        "encoding_ver": version,
        "num_ascii_tags": 14,
        "all_sensors": "T",
        "the8x3_filename": "00010000",
        "full_filename": "unit-2024-001-0-0",
        "filename_extension": "dbd",
        "mission_name": "TEST.MI",
        "fileopen_time": "Mon_Jan__1_00:00:00_2024",
        "total_num_sensors": len(sensors),
        "sensors_per_cycle": len(sensors),
        "state_bytes_per_cycle": -(-len(sensors) // 4),
        "sensor_list_crc": cache or "abcdef01",
        "sensor_list_factored": int(bool(cache)),
    }
    return "".join(f"{name}:    {value}\n" for name, value in tags.items()).encode()


def record(sensors: dict[str, int], values: dict[str, float]) -> bytes:
    """Return one record: the tag, two bits a sensor, and the values that are given."""
    states = [2 if name in values else 0 for name in sensors]
    states += [0] * (-len(states) % 4)
    packed = bytes(
        states[i] << 6 | states[i + 1] << 4 | states[i + 2] << 2 | states[i + 3] for i in range(0, len(states), 4)
    )
    cast = {name: int(value) if sensors[name] < 4 else value for name, value in values.items()}
    return (
        b"d"
        + packed
        + b"".join(struct.pack(f"<{_CODES[size]}", cast[name]) for name, size in sensors.items() if name in values)
    )


def dbd(sensors: dict[str, int], rows: list[dict[str, float]], *, cache: str = "", version: int = 5) -> bytes:
    """Return a whole file, closed by its end mark."""
    start = header(sensors, cache=cache, version=version) + (b"" if cache else sensor_list(sensors)) + KNOWN
    return start + b"".join(record(sensors, row) for row in rows) + b"X"


def compressed(data: bytes, block: int = 512) -> bytes:
    """Return `data` as a series of LZ4 blocks, each after its length in two bytes."""
    import lz4.block

    blocks = (lz4.block.compress(data[i : i + block], store_size=False) for i in range(0, len(data), block))
    return b"".join(len(packed).to_bytes(2, "big") + packed for packed in blocks)


def write(folder: Path, name: str, data: bytes) -> Path:
    """Write `data` into `folder`, which is made, and return the path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_bytes(data)
    return path
