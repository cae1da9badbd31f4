"""What the pages share: one HTML file with everything inside, and a policy that forbids the rest.

Only the scripts whose hashes the policy names may run, so that no file name can.
"""

import base64
import hashlib
import html
import importlib.resources
import re
from collections.abc import Mapping


def own_text(name: str) -> str:
    """A file that lies beside this one."""
    return importlib.resources.files("coordinator.export").joinpath(name).read_text("utf-8")


def filled(template: str, parts: Mapping[str, str], *scripts: str) -> bytes:
    """Put the parts, which must be HTML already, where `template` has `{{name}}`; as UTF-8.

    scripts : those that may run; `{{policy}}` becomes the policy that says so. A byte of a name
        that is no UTF-8 is shown as a question mark.
    """
    known = {**parts, "policy": html.escape(_policy(*scripts))}
    page = re.sub(r"\{\{(\w+)\}\}", lambda slot: known[slot.group(1)], own_text(template))
    return page.encode(errors="replace")


def _policy(*scripts: str) -> str:
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
        for script in scripts
    )
    return (
        "default-src 'none'; "
        f"script-src {hashes}; "
        "style-src 'unsafe-inline'; img-src data: blob:; worker-src blob:; "
        "base-uri 'none'; form-action 'none'"
    )
