"""Geodesy: how many metres east and north one place is of another, on the WGS 84 ellipsoid; where a mission is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Semi-major axis, m, and first eccentricity squared of WGS 84.
WGS84 = (6378137.0, 6.69437999014e-3)
#: Degrees north, where neither mission.yaml nor fixes tell: gravity and depth are wrong by up to 0.3 %.
LATITUDE = 45.0


def typical_latitude(fixes: ArrayLike | None, stated: float | None = None) -> float:
    """Return the latitude of a mission, degrees north: `stated`, else the median of `fixes`, else `LATITUDE`.

    Parameters
    ----------
    fixes
        Latitudes of fixes, degrees north, shape (n,); those that are NaN or beyond a pole are none.
    stated
        What mission.yaml says.
    """
    if stated is not None:
        return stated
    found = np.asarray([] if fixes is None else fixes, dtype=np.float64)
    found = found[np.abs(found) <= 90.0]
    return float(np.median(found)) if found.size else LATITUDE


def radii(latitude: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the radii of curvature along the meridian and across it.

    Parameters
    ----------
    latitude
        Degrees north, any shape.

    Returns
    -------
    meridian, prime_vertical
        m, each of the shape of `latitude`.
    """
    axis, squeeze = WGS84
    bulge = 1.0 - squeeze * np.sin(np.radians(np.asarray(latitude, dtype=np.float64))) ** 2
    return np.asarray(axis * (1.0 - squeeze) / bulge**1.5), np.asarray(axis / np.sqrt(bulge))


def apart(
    latitude: ArrayLike, longitude: ArrayLike, from_latitude: ArrayLike, from_longitude: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far places are east and north of others, by the radii at the latitude half-way.

    Good to a metre in a hundred kilometres away from the poles; longitudes may run from −180 or from 0.

    Parameters
    ----------
    latitude, longitude
        Degrees north and east.
    from_latitude, from_longitude
        Of the places that are measured from, of a shape that broadcasts with the former.

    Returns
    -------
    east, north
        m.
    """
    here, there = np.asarray(latitude, dtype=np.float64), np.asarray(from_latitude, dtype=np.float64)
    middle = 0.5 * (here + there)
    meridian, prime = radii(middle)
    turned = (np.asarray(longitude, dtype=np.float64) - np.asarray(from_longitude, dtype=np.float64) + 180.0) % 360.0
    east = np.radians(turned - 180.0) * prime * np.cos(np.radians(middle))
    return np.asarray(east), np.asarray(np.radians(here - there) * meridian)
