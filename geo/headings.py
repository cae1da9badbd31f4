"""Headings from one north to another."""

from contracts.config import North


def true_heading_deg(
    heading_deg: float | None,
    north: North,
    convergence_deg: float,
    declination_deg: float | None = None,
) -> float | None:
    """A heading clockwise from true north.

    Parameters
    ----------
    heading_deg : degrees clockwise from `north`, any turn; None: not known.
    north : which north the survey's headings start from.
    convergence_deg : bearing of grid north from true north (`ToWgs84.convergence_deg`).
    declination_deg : bearing of magnetic north from true north, east positive; None: not known.

    Returns
    -------
    heading in [0, 360) degrees, or None when it is not known: no heading was given, or it is
    magnetic and the declination of that place and day is not known. A magnetic heading taken
    for a true one would be wrong by up to tens of degrees.
    """
    if heading_deg is None:
        return None
    if north == "grid":
        return wrapped_360(heading_deg + convergence_deg)
    if north == "true":
        return wrapped_360(heading_deg)
    return None if declination_deg is None else wrapped_360(heading_deg + declination_deg)


def wrapped_360(angle_deg: float) -> float:
    """The same direction within [0, 360) degrees."""
    turned = angle_deg % 360.0
    # A tiny negative angle is rounded up to a whole turn.
    return 0.0 if turned == 360.0 else turned
