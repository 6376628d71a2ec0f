"""What the report finds itself: logs of another make than the vehicle, configurations that were not flown."""

from dataclasses import replace

from synthetic import blocks, inputs

from pipeline.mission import Configuration
from pipeline.report.corrected import correct
from pipeline.report.inventory import findings
from pipeline.vehicle import load

#: As the adjustment of the force model reports it.
PARASITE = {
    "parasite_drag": {"value": 0.2, "before": 0.0, "std": 0.02, "std_before": 0.1, "verdict": "determined"},
}  # fmt: skip


def told(given) -> list[str]:
    return [f"{row['where']}: {row['found']}; {row['remedy']}" for row in findings(given) if row["stage"] == "report"]


def read(given, form: str, *names: str):
    files = {"stages": {"ingest": {"inputs": dict.fromkeys(names, "0" * 32)}}}
    return replace(given, ingest={**given.ingest, "format": form}, provenance=files)


def test_files_of_another_make_than_the_vehicle_are_told(mission, petrel):
    slocum, seaglider, own = (
        inputs(mission, load(name), blocks(dives=2)) for name in ("slocum-g2", "seaglider", "petrel-ii")
    )
    remedy = "its lift, drag and mass are those of another"
    assert f"vehicle: 'slocum-g2' and files of a seaglider; {remedy}" in told(read(slocum, "seaglider", "p1710003.nc"))
    assert f"vehicle: 'seaglider' and files of a seaexplorer; {remedy}" in told(
        read(seaglider, "table", "sea063.12.gli.sub.1.gz")
    )
    for given, form in ((slocum, "slocum"), (seaglider, "seaglider"), (own, "seaglider"), (slocum, "table")):
        assert not any(remedy in line for line in told(read(given, form, "ctd.csv")))


def test_dives_of_a_configuration_that_were_not_flown_are_told(mission, petrel):
    configurations = [Configuration(name="bare", dives=(1, 1)), Configuration(name="probe", dives=(2, 90)),
                      Configuration(name="late", dives=(91, 95))]  # fmt: skip
    given = inputs(mission.model_copy(update={"configurations": configurations}), petrel, blocks(dives=3))
    last = int(given.records["dive"].max())
    assert [line for line in told(given) if line.startswith("configurations")] == [
        "configurations: probe: dives 2 to 90; it ends with the last",
        "configurations: late: dives 91 to 95; the configuration has no dive",
    ]
    assert any(row["expected"] == f"dives from 1 to {last}" for row in findings(given))


def test_a_vehicle_that_this_mission_has_corrected_is_told(mission, petrel):
    def given(source: str):
        drag = replace(petrel.coefficients["parasite_drag"], source=source)
        return inputs(mission, replace(petrel, coefficients={**petrel.coefficients, "parasite_drag": drag}), blocks())

    force = {"parameters": PARASITE, "converged": True}
    again = correct(petrel, mission, {"force": force}).vehicle.coefficients["parasite_drag"].source
    (line,) = (line for line in told(given(again)) if "fitted to this mission" in line)
    assert line == (
        "vehicle: parasite_drag fitted to this mission; theory is compared with what it was fitted to, and every 1σ is "
        "too small: name it for other missions"
    )
    for other in (again.replace(mission.slug, "another"), petrel.coefficients["parasite_drag"].source):
        assert not any("fitted to this mission" in line for line in told(given(other)))
