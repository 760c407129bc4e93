# SPDX-License-Identifier: Apache-2.0
"""How long axes will take: from their past runs, else from a rehearsal.

The node has no simulated machine, and its cycle must not wait for one. With the parameter
`layout` it lets `homing run` rehearse an axis from where it is: in a process of its own, of the
lowest priority, one axis after another, and none while an axis of the node homes. An answer never
waits for that.
"""

import json
import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..core.axis import Axis
from ..parameters import yaml_file
from ..parameters.definition import InvalidParameters
from .configured_node import ConfiguredNode

#: How often it is looked whether an axis can be rehearsed, or has been; longest rehearsal, s.
LOOK, PATIENCE = 0.5, 60.0
#: What the process runs: the command `homing`.
COMMAND = 'import os, sys; os.nice(19); from homing_node.start import homing; sys.exit(homing())'

NO_LAYOUT = 'no run with the present velocities is known, and `layout` is not given'
NOT_YET = 'the rehearsal has not ended yet'


class Rehearsals:
    """The expected times of all axes of the node. ``lock`` guards the axes."""

    def __init__(
        self,
        node: ConfiguredNode,
        axes: Mapping[str, Axis],
        past: Callable[[str], float],
        lock: threading.Lock,
    ) -> None:
        """Look for the layout.

        Args:
            node: The node.
            axes: The axes, by name.
            past: Returns how long the past runs of an axis took, s; NaN if there are none.
            lock: What guards the axes.

        Raises:
            InvalidParameters: There is no such file.
        """
        self._node, self._axes, self._past, self._lock = node, axes, past, lock
        layout = node.configuration.layout
        self._layout = Path(layout).resolve() if layout else None
        if self._layout is not None and not self._layout.is_file():
            raise InvalidParameters([f'layout: {self._layout} is not a file'])
        self._times: dict[str, float] = {}
        self._why = dict.fromkeys(axes, NO_LAYOUT if self._layout is None else NOT_YET)
        self._due: dict[str, dict[str, object]] = {}  # the parameters of the axes to be rehearsed
        self._thread: threading.Thread | None = None

    def start(self, ended: Callable[[], bool]) -> None:
        """Rehearse until the node has ended."""
        if self._layout is not None:
            with self._lock:
                for name in self._axes:
                    self.renew(name)
            self._thread = threading.Thread(target=self._run, args=(ended,), name='rehearsals')
            self._thread.start()

    def join(self) -> None:
        """Wait for the thread."""
        if self._thread is not None:
            self._thread.join()

    def renew(self, name: str) -> None:
        """Rehearse an axis anew, whose parameters have changed; the lock is held."""
        if self._layout is not None:
            self._times.pop(name, None)
            self._why[name] = NOT_YET
            self._due[name] = self._node.values_of(name)

    def expected(self, name: str) -> float:
        """Return how long a run of an axis takes, s; NaN if it is not known. The lock is held."""
        past = self._past(name)
        return self._times.get(name, math.nan) if math.isnan(past) else past

    def unknown(self, names: Sequence[str]) -> str:
        """Say of which axes it is not known how long they take, and why; the lock is held."""
        found: dict[str, list[str]] = {}
        for name in names:
            if math.isnan(self.expected(name)):
                found.setdefault(self._why[name], []).append(name)
        return '; '.join(
            f'how long {" and ".join(of)} will take is not known: {why}'
            for why, of in found.items()
        )

    # ------------------------------------------------------------------------------- the thread

    def _run(self, ended: Callable[[], bool]) -> None:
        with TemporaryDirectory(prefix='homing_rehearsal_') as folder:
            while not ended():
                name, values, start = self._next()
                if not name:
                    time.sleep(LOOK)
                    continue
                file = Path(folder) / f'{name}.yaml'
                node = self._node.get_fully_qualified_name()
                file.write_text(yaml_file.written(node, values), encoding='utf-8')
                argv = [sys.executable, '-c', COMMAND, 'run', str(file), '--node', node, '--json']
                argv += ['--layout', str(self._layout), '--axis', name, f'--from={start!r}']
                duration, why = _judged(*_output(argv, folder, ended))
                if ended():
                    return
                if why:
                    text = f'axis {name}: how long it takes is not known: {why}'
                    self._node.get_logger().warning(text)
                with self._lock:
                    if name not in self._due:  # else its parameters have changed meanwhile
                        self._times[name], self._why[name] = duration, why

    def _next(self) -> tuple[str, dict[str, object], float]:
        """Return an axis to rehearse now, its parameters, and where it is; '': none."""
        with self._lock:
            if any(axis.running for axis in self._axes.values()):
                return '', {}, 0.0
            for name in list(self._due):
                axis = self._axes[name]
                if not math.isnan(self._past(name)):
                    del self._due[name]
                elif axis.readings.track.samples:
                    return name, self._due.pop(name), axis.raw_position
        return '', {}, 0.0


def _output(argv: Sequence[str], folder: str, ended: Callable[[], bool]) -> tuple[str, str]:
    """Run a process to its end, or to that of the node; return what it printed."""
    process = subprocess.Popen(
        argv,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=folder,
        text=True,
    )
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return process.communicate(timeout=LOOK)
        except subprocess.TimeoutExpired:
            if ended() or time.monotonic() > until:
                process.kill()
                process.communicate()
                return '', f'the rehearsal lasted longer than {PATIENCE:g} s'


def _judged(output: str, errors: str) -> tuple[float, str]:
    """Return how long a rehearsal says that a run takes, s, and why it does not say it."""
    try:
        (run,) = json.loads(output)['runs']
    except ValueError:
        lines: list[Any] = errors.strip().splitlines()
        return math.nan, f'it cannot be rehearsed: {lines[0] if lines else "no reason is given"}'
    if not run['success']:
        return math.nan, f'its rehearsal failed: {run["message"] or run["error"]}'
    return float(run['time']), ''
