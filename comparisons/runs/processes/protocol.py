"""The messages of a worker to its pool.

Each line of its standard input is a JSON object, a request; each line of its standard output
is a message about it:

    {"say": text}          any number of times, what is being done
    {"done": true}         what was asked for is where it was to be put
    {"failed": text}       it could not be made, and why
    {"invalid": text}      the same, because a scene, or a file that it names, is invalid
    {"unavailable": text}  nothing can be made here, and why
"""

import faulthandler
import json
import os
import sys
import traceback
from collections.abc import Callable
from typing import Any, TextIO, TypeVar

from pydantic import BaseModel

from reference_rt.util.errors import ReferenceRtError, ReferenceUnavailableError, SceneError


def private_stdout() -> TextIO:
    """Standard output for this caller alone: from now on whatever else prints, in Python or not,
    goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return answers


def send(answers: TextIO, **message: Any) -> None:
    """Write one line of the protocol."""
    print(json.dumps(message), file=answers, flush=True)


def carry_out(task: Callable[[], None], answers: TextIO) -> None:
    """Run the task, and send how it ended."""
    try:
        task()
    except BrokenPipeError:  # nobody listens any more
        raise
    except ReferenceUnavailableError as error:
        send(answers, unavailable=str(error))
    except SceneError as error:
        send(answers, invalid=str(error))
    except ReferenceRtError as error:
        send(answers, failed=str(error))
    except (Exception, SystemExit) as error:
        traceback.print_exc()
        send(answers, failed=f"{type(error).__name__}: {' '.join(str(error).split())}")
    else:
        send(answers, done=True)


M = TypeVar("M", bound=BaseModel)


def serve(kind: type[M], task: Callable[[M], None]) -> None:
    """Carry out requests of this kind until standard input ends."""
    faulthandler.enable()
    answers = private_stdout()
    for line in sys.stdin:
        request = kind.model_validate_json(line)
        carry_out(lambda request=request: task(request), answers)  # type: ignore[misc]
