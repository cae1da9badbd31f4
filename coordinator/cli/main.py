"""Puts the verbs together and maps errors to exit codes."""

import errno
import sys
from collections.abc import Callable
from functools import wraps
from typing import Annotated

import typer

from contracts.errors import FlaneurError, WrongInput
from coordinator.cli import (
    add,
    batch,
    codebook,
    compact,
    demo,
    doctor,
    evaluate,
    export,
    index,
    inspect,
    job,
    locate,
    plan,
    publish,
    remove,
    rollback,
    status,
    train,
    verify,
    worker,
)
from coordinator.cli.show import complain

FAILED, WRONG_USAGE = 1, 2
RESUMED = "What is indexed stays so: run the same command again to go on."


def _guarded(command: Callable[..., int | None], stopped: str = "") -> Callable[..., None]:
    """A verb whose errors become messages and exit codes, with a traceback only for `--debug`.

    stopped : what a person should know after Ctrl-C.
    """

    @wraps(command)
    def run(*arguments: object, **options: object) -> None:
        try:
            code = command(*arguments, **options)
        except KeyboardInterrupt:
            complain(f"Stopped. {stopped}".rstrip())
            code = FAILED
        except (FlaneurError, OSError) as error:
            if "--debug" in sys.argv:
                raise
            complain(_of_system(error) if isinstance(error, OSError) else str(error))
            code = WRONG_USAGE if isinstance(error, WrongInput) else FAILED
        except Exception as error:
            if "--debug" in sys.argv:
                raise
            complain(
                f"Flaneur failed in a way it should not: {type(error).__name__}: {error}. Please "
                "report it with what this prints: flaneur --debug, then the same verb and options."
            )
            code = FAILED
        raise typer.Exit(code or 0)

    return run


def _of_system(error: OSError) -> str:
    """The name first, without a number that says nothing."""
    if error.strerror is None:
        return str(error)
    if error.errno == errno.ENOSPC:
        return f"{error.filename or 'The disk'}: no space left. Make room and run it again."
    return f"{error.filename}: {error.strerror}" if error.filename else error.strerror


main = typer.Typer(
    name="flaneur",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for verb in (demo, index, add, compact):
    main.command(verb.NAME)(_guarded(verb.command, RESUMED))
for verb in (
    *(doctor, plan, locate, inspect, train, evaluate),
    *(remove, rollback, publish, status, verify, worker),
):
    main.command(verb.NAME)(_guarded(verb.command))
for group in (batch, job, export, codebook):
    verbs = typer.Typer(no_args_is_help=True, help=group.HELP)
    for name, command in group.COMMANDS.items():
        verbs.command(name)(_guarded(command))
    main.add_typer(verbs, name=group.NAME)


@main.callback()
def options(
    debug: Annotated[
        bool, typer.Option("--debug", help="Show tracebacks (before the verb).")
    ] = False,
) -> None:
    """Finds where a photograph was taken, against a posed street-level survey."""
