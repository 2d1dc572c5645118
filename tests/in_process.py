"""Commands in this process, which saves the time of starting another one."""

import contextlib
import io
import json
from typing import NamedTuple

import pytest

from jamshape.commands import main


class Ended(NamedTuple):
    """Result of a command."""

    code: int | str | None
    """The code of `SystemExit`: a text is a sentence on standard error."""
    out: str
    arguments: tuple
    """To end so again."""

    @property
    def report(self):
        return json.loads(self.out.splitlines()[-1], parse_constant=pytest.fail)


def jamshape(*arguments):
    """Run a command line in this process."""
    with contextlib.redirect_stdout(io.StringIO()) as out, pytest.raises(SystemExit) as end:
        main([str(one) for one in arguments])
    return Ended(end.value.code, out.getvalue(), arguments)
