"""Processes that work for another one: they start once, take any number of tasks, and end with it.

Each has one thread for linear algebra, so that results depend neither on the number of workers nor on who computes what.
Unlike those of `multiprocessing` they do not import the caller's script, and a task that ends its process, as a fault in a
library does, is a failure of that task alone.
"""

from __future__ import annotations

import importlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, NamedTuple, Self

_SERVE = "from jamshape.recording.workers import serve; serve()"

# BLAS threads would only compete.
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


class Done(NamedTuple):
    """End of a task."""

    number: int
    """Place in the list of tasks."""
    result: Any = None
    failure: str | None = None
    """Reason for which there is no result, the message of an expected error, or the end of the process."""


PROBLEMS = (OSError, ValueError, RuntimeError, ImportError)
"""Expected errors of a task; any other one is raised for the caller."""


def cores() -> int:
    """Count the cores available to this process, in a cluster job possibly fewer than those of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def python_path() -> str:
    """Return the search path on which a process finds this jamshape first."""
    before = os.environ.get("PYTHONPATH")
    return os.pathsep.join([str(Path(__file__).parents[2]), *([before] if before else [])])


class Workers:
    """Workers that compute ``function(*task)`` for all tasks; a context, which ends them.

    Parameters
    ----------
    function : str
        Module and name, such as ``jamshape.front.ensembles:sample``.
    tasks : sequence of tuples
        Arguments, which are pickled, as are results.
    jobs : int
        Largest number of processes.
    label : str
        Shown among the arguments of the processes, for whoever lists them.
    """

    def __init__(
        self, function: str, tasks: Sequence[tuple[Any, ...]], jobs: int, label: str = ""
    ) -> None:
        self._function, self._tasks, self._label = function, tasks, label
        self._next = iter(range(len(tasks)))
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._done: queue.SimpleQueue[Done | BaseException] = queue.SimpleQueue()
        self._processes: list[subprocess.Popen[bytes]] = []
        for _ in range(min(jobs, len(tasks))):
            threading.Thread(target=self._feed, daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Done]:
        """Yield the end of each task as it comes."""
        for _ in self._tasks:
            while (done := self.wait()) is None:
                pass
            yield done

    def wait(self, seconds: float = 0.2) -> Done | None:
        """Return the end of a task, or None if there is none for a time."""
        try:
            done = self._done.get(timeout=seconds)
        except queue.Empty:
            return None
        if isinstance(done, BaseException):
            raise done
        return done

    def close(self) -> None:
        """End all workers at once, whatever they do."""
        self._ended.set()
        with self._lock:
            for process in self._processes:
                process.kill()

    def _take(self) -> int | None:
        with self._lock:
            return next(self._next, None)

    def _feed(self) -> None:
        """Give one worker after another tasks until there are none."""
        try:
            while not self._ended.is_set() and (number := self._take()) is not None:
                self._employ(number)
        except BaseException as error:  # noqa: BLE001 - raised by `wait`
            self._done.put(error)

    def _employ(self, number: int | None) -> None:
        """Start a worker, and give it tasks until there are none, or it has ended."""
        with self._started() as process:
            while number is not None:
                try:
                    _send(process.stdin, (self._function, self._tasks[number]))
                    result, failure = pickle.load(process.stdout)  # type: ignore[arg-type]
                except (EOFError, OSError, pickle.UnpicklingError):
                    with suppress(OSError):  # of what was not sent
                        process.stdin.close()  # type: ignore[union-attr]
                    code = process.wait()
                    if not self._ended.is_set():
                        self._done.put(
                            Done(number, None, f"its process ended with exit code {code}")
                        )
                    return
                if isinstance(failure, BaseException):
                    raise failure
                self._done.put(Done(number, result, failure))
                number = None if self._ended.is_set() else self._take()
            process.kill()

    def _started(self) -> subprocess.Popen[bytes]:
        # -P: files in the working directory are not modules of ours.
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", _SERVE, self._label],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | _ONE_THREAD | {"PYTHONPATH": python_path()},
        )
        with self._lock:
            self._processes.append(process)
            if self._ended.is_set():
                process.kill()
        return process


def _send(pipe: IO[bytes] | None, message: Any) -> None:
    assert pipe is not None
    pickle.dump(message, pipe, pickle.HIGHEST_PROTOCOL)
    pipe.flush()


def serve() -> None:
    """Work for the process at the other end of standard input and output, and end when it ends."""
    for one in (signal.SIGINT, signal.SIGTERM):  # are its business
        signal.signal(one, signal.SIG_IGN)
    tasks: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(sys.stdin.buffer, tasks), daemon=True).start()
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # what libraries print
        while True:
            name, arguments = tasks.get()
            module, _, function = name.partition(":")
            with suppress(BrokenPipeError):
                _send(answers, _answer(module, function, arguments))


def _receive(pipe: IO[bytes], tasks: queue.SimpleQueue[Any]) -> None:
    """Read tasks; the end of the pipe ends the process, whatever it computes."""
    try:
        while True:
            tasks.put(pickle.load(pipe))
    except EOFError:
        os._exit(0)
    except BaseException:  # noqa: BLE001 - nothing can be answered any more
        traceback.print_exc()
        os._exit(1)


def _answer(module: str, function: str, arguments: tuple[Any, ...]) -> tuple[Any, Any]:
    """Return a result, and why there is none: a text, or an unexpected error."""
    try:
        return getattr(importlib.import_module(module), function)(*arguments), None
    except PROBLEMS as error:
        return None, str(error)
    except Exception as error:  # noqa: BLE001 - raised where it is read
        error.add_note(traceback.format_exc())
        return None, error
