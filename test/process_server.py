# SPDX-License-Identifier: Apache-2.0
"""Forks the executables of the package from a process that has imported them already.

To import ROS takes a second of a processor, and the tests start some two hundred processes. A
forked process has parameters, a domain and a log of its own. It ends when its main function does:
how an interpreter ends with ROS in it is asked of processes that start anew (test_node_life.py).

Orders come from the standard input, answers go to the standard output, a line of JSON each:
``{number, module, arguments, environment, input, log}`` -> ``[number, "pid", PID]`` and, at the
end of that process, ``[number, "status", STATUS]``. ``input`` and ``log`` are files. When the
orders end, all processes are killed.
"""

import json
import os
import select
import signal
import sys
import traceback
from importlib import import_module

MODULES = (
    'homing_node.ros.main',
    'homing_node.ros.coordinator',
    'homing_node.ros.relay.homed_axes',
    'homing_node.ros.simulated.axes',
    'controller_stand_in',
    'gantry_wires',
)


def become(order):
    """Make this process the one that was ordered, up to the call of its main function."""
    log = os.open(order['log'], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    given = os.open(order['input'], os.O_RDONLY)
    for source, target in ((given, 0), (log, 1), (log, 2)):
        os.dup2(source, target)
    os.close(log)
    os.close(given)
    os.environ.clear()
    os.environ.update(order['environment'])
    sys.argv = ['-c', *order['arguments']]


def serve():
    """Fork what is ordered; return an order in the process that was forked for it."""
    answers = os.dup(1)
    os.dup2(2, 1)  # what a module prints is no answer
    children = {}  # pidfd -> (number, pid)
    rest = b''

    def answer(*parts):
        os.write(answers, json.dumps(parts).encode() + b'\n')

    while True:
        for ready in select.select([0, *children], [], [])[0]:
            if ready:
                number, pid = children.pop(ready)
                os.close(ready)
                status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                answer(number, 'status', status)
                continue
            data = os.read(0, 65536)
            if not data:
                for _, pid in children.values():
                    os.kill(pid, signal.SIGKILL)
                return None
            *lines, rest = (rest + data).split(b'\n')
            for line in lines:
                order = json.loads(line)
                pid = os.fork()
                if not pid:
                    for descriptor in (answers, *children):
                        os.close(descriptor)
                    return order
                children[os.pidfd_open(pid)] = order['number'], pid
                answer(order['number'], 'pid', pid)


def run(order):
    """Become the process that was ordered; return its exit status."""
    become(order)
    try:
        return import_module(order['module']).main() or 0
    except BaseException:
        traceback.print_exc()
        return 1


if __name__ == '__main__':
    for module in MODULES:
        import_module(module)
    order = serve()
    if order is not None:
        status = run(order)
        sys.stdout.flush()
        sys.stderr.flush()
        # LTTng, which ROS loads, would end threads that were not forked.
        os._exit(status)
