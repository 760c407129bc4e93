# SPDX-License-Identifier: Apache-2.0
"""Two hosts on one machine: network namespaces, and a cable that delays, drops and can be cut.

The cable is a pair of TAP devices whose frames a process carries over, because `tc netem` is not
in every kernel. Needs root, iproute2 and /dev/net/tun. Run as a program it is that process.
"""

import ctypes
import fcntl
import heapq
import json
import os
import random
import select
import shutil
import socket
import struct
import subprocess
import sys
import threading
import time
from itertools import count
from pathlib import Path

TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000


def missing():
    """Return why there can be no cable here, '' where there can."""
    if os.geteuid() != 0:
        return 'two hosts need root'
    if not shutil.which('ip'):
        return 'two hosts need iproute2'
    if not os.access('/dev/net/tun', os.R_OK | os.W_OK):
        return 'two hosts need /dev/net/tun'
    tried = subprocess.run(['ip', 'netns', 'add', f'hn{os.getpid()}'], capture_output=True)
    if tried.returncode:
        return f'two hosts need network namespaces: {tried.stderr.decode().strip()}'
    subprocess.run(['ip', 'netns', 'del', f'hn{os.getpid()}'], check=True)
    return ''


class Cable:
    """Two hosts, `near` and `far`, and what is between them."""

    def __init__(self):
        self.near, self.far = f'hn{os.getpid()}a', f'hn{os.getpid()}b'
        ends = []
        try:
            for host, address in ((self.near, '10.77.0.1/24'), (self.far, '10.77.0.2/24')):
                _ip('netns', 'add', host)
                ends.append(_tap(host))
                _ip('-n', host, 'addr', 'add', address, 'dev', 'tap0')
                for device in ('lo', 'tap0'):
                    _ip('-n', host, 'link', 'set', device, 'up')
                _ip('-n', host, 'route', 'add', 'default', 'dev', 'tap0')
            self._settings, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            with theirs:
                passed = theirs.fileno(), *ends
                self._carrier = subprocess.Popen(
                    [sys.executable, __file__, *map(str, passed)], pass_fds=passed
                )
        except BaseException:
            self._remove()
            raise
        finally:
            for end in ends:
                os.close(end)

    def set(self, **settings):
        """Set `delay`, `jitter` (s), `loss` (a part of 1), `cut`; what is not named stays."""
        self._settings.send(json.dumps(settings).encode())

    def close(self):
        self._settings.close()
        assert self._carrier.wait(10.0) == 0
        self._remove()

    def run(self, host, arguments, log, **environment):
        """Start Python on a host."""
        with log.open('w') as file:
            return subprocess.Popen(
                ['ip', 'netns', 'exec', host, sys.executable, *arguments],
                env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', **environment},
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=file,
            )

    def _remove(self):
        for host in (self.near, self.far):
            subprocess.run(['ip', 'netns', 'del', host], capture_output=True)


def _ip(*arguments):
    subprocess.run(['ip', *arguments], check=True, capture_output=True)


def _tap(host):
    """Return a TAP device in a namespace; a thread of its own goes there for it."""
    made = []

    def make():
        with Path(f'/run/netns/{host}').open() as namespace:
            if ctypes.CDLL(None, use_errno=True).setns(namespace.fileno(), 0):
                return
        tap = os.open('/dev/net/tun', os.O_RDWR)
        fcntl.ioctl(tap, TUNSETIFF, struct.pack('16sH22x', b'tap0', IFF_TAP | IFF_NO_PI))
        made.append(tap)

    thread = threading.Thread(target=make)
    thread.start()
    thread.join()
    if not made:
        raise OSError(f'no TAP device in {host}')
    return made[0]


def carry(settings, *ends):
    """Carry frames from either end to the other until the socket of the settings is closed.

    In a process of its own, before others: no busy machine or interpreter holds it up.
    """
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    chance, order, under_way = random.Random(0), count(), []
    other = dict(zip(ends, reversed(ends), strict=True))
    now = {'delay': 0.0, 'jitter': 0.0, 'loss': 0.0, 'cut': False}
    while True:
        wait = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
        ready, _, _ = select.select([settings, *ends], [], [], wait)
        if settings in ready:
            told = os.read(settings, 65536)
            if not told:
                return
            now.update(json.loads(told))
        for end in (end for end in ends if end in ready):
            frame = os.read(end, 65536)
            if not now['cut'] and chance.random() >= now['loss']:
                due = time.monotonic() + now['delay'] + chance.uniform(0.0, now['jitter'])
                heapq.heappush(under_way, (due, next(order), other[end], frame))
        while under_way and under_way[0][0] <= time.monotonic():
            _, _, end, frame = heapq.heappop(under_way)
            if not now['cut']:
                os.write(end, frame)


if __name__ == '__main__':
    carry(*map(int, sys.argv[1:]))
