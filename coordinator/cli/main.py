"""Puts the verbs together and maps errors to exit codes."""

import logging
import sys
from typing import Annotated

import click
import typer

from contracts.errors import FlaneurError, WrongInput
from coordinator.cli import demo, evaluate, index, locate, train, worker
from coordinator.cli.show import complain

FAILED, WRONG_USAGE = 1, 2

app = typer.Typer(
    name="flaneur",
    help="Finds where a photograph was taken, against a posed street-level survey.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for verb in (demo, index, locate, train, evaluate, worker):
    app.command(verb.NAME)(verb.command)


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks.")] = False,
) -> None:
    """Finds where a photograph was taken, against a posed street-level survey."""
    if debug:
        logging.basicConfig(level=logging.DEBUG)


def main() -> None:
    """Run the command line; never shows a traceback unless asked with `--debug`."""
    debug = "--debug" in sys.argv[1:]
    try:
        code = app(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        code = WRONG_USAGE
    except (click.Abort, KeyboardInterrupt):
        complain("Stopped. What is done stays done: run the same command again to go on.")
        code = FAILED
    except (FlaneurError, OSError) as error:
        if debug:
            raise
        complain(str(error))
        code = WRONG_USAGE if isinstance(error, WrongInput) else FAILED
    sys.exit(code or 0)
