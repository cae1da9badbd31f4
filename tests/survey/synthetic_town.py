"""The demo's town, built once for all tests: it takes seconds."""

from functools import cache

from survey.synthetic.street import StreetPlan
from survey.synthetic.town import Town, build_town


@cache
def demo_town() -> Town:
    return build_town(StreetPlan(), 0)
