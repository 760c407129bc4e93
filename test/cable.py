"""Two hosts on one machine: network namespaces, and a cable that delays, drops and can be cut.

The cable is a pair of TAP devices whose frames a thread carries over, because `tc netem` is not
in every kernel. Needs root, iproute2 and /dev/net/tun. Run as a program it is the client on one of
the hosts: it homes an axis and tells how that went.
"""

import ctypes
import fcntl
import heapq
import json
import os
import random
import select
import shutil
import struct
import subprocess
import sys
import threading
import time
from itertools import count
from pathlib import Path

TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000


#: How a request is refused that comes before the plant is heard, or its drive is on again.
UNREADY = ('SwitchUnknown', 'FeedbackStale', 'ServoOff')


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
    """Two hosts, `near` and `far`, and what is between them.

    ``delay`` and ``jitter`` in s, ``loss`` a part of 1, ``cut`` at any time.
    """

    def __init__(self):
        self.near, self.far = f'hn{os.getpid()}a', f'hn{os.getpid()}b'
        self.delay = self.jitter = self.loss = 0.0
        self.cut = False
        self._ended = threading.Event()
        self._ends = []
        try:
            for host, address in ((self.near, '10.77.0.1/24'), (self.far, '10.77.0.2/24')):
                _ip('netns', 'add', host)
                self._ends.append(_tap(host))
                _ip('-n', host, 'addr', 'add', address, 'dev', 'tap0')
                for device in ('lo', 'tap0'):
                    _ip('-n', host, 'link', 'set', device, 'up')
                _ip('-n', host, 'route', 'add', 'default', 'dev', 'tap0')
        except BaseException:
            self._remove()
            raise
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def close(self):
        self._ended.set()
        self._thread.join()
        self._remove()

    def run(self, host, arguments, log, **environment):
        """Start Python on a host."""
        with log.open('w') as file:
            return subprocess.Popen(
                ['ip', 'netns', 'exec', host, sys.executable, *arguments],
                env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', **environment},
                stdin=subprocess.DEVNULL, stdout=file, stderr=file)

    def _remove(self):
        for end in self._ends:
            os.close(end)
        for host in (self.near, self.far):
            subprocess.run(['ip', 'netns', 'del', host], capture_output=True)

    def _carry(self):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))  # a busy machine, too
        chance, order, under_way = random.Random(0), count(), []
        other = dict(zip(self._ends, reversed(self._ends), strict=True))
        while not self._ended.is_set():
            wait = under_way[0][0] - time.monotonic() if under_way else 0.05
            for end in select.select(self._ends, [], [], min(max(wait, 0.0), 0.05))[0]:
                frame = os.read(end, 65536)
                if not self.cut and chance.random() >= self.loss:
                    due = time.monotonic() + self.delay + chance.uniform(0.0, self.jitter)
                    heapq.heappush(under_way, (due, next(order), other[end], frame))
            while under_way and under_way[0][0] <= time.monotonic():
                _, _, end, frame = heapq.heappop(under_way)
                if not self.cut:
                    os.write(end, frame)


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


def home(axis):
    """Home an axis; print `moving` once it does, then what happened as one line of JSON."""
    import rclpy
    from sensor_msgs.msg import JointState
    from std_srvs.srv import SetBool, Trigger
    from trajectory_msgs.msg import JointTrajectory

    rclpy.init()
    node = rclpy.create_node('client', enable_rosout=False)
    setpoints, feedback = [], []
    node.create_subscription(
        JointTrajectory, '/homing_node/setpoints',
        lambda m: setpoints.append((m.points[0].positions[0], m.points[0].velocities[0])), 1000)
    node.create_subscription(
        JointState, '/joint_states', lambda m: feedback.append(m.position[0]), 100)
    servo = node.create_client(SetBool, f'/homing_node/{axis}/servo')
    client = node.create_client(Trigger, f'/homing_node/{axis}/home')
    until = time.monotonic() + 40.0
    servo.wait_for_service(40.0)
    for on in (False, True):  # a drive that stopped by itself has to be switched on again
        rclpy.spin_until_future_complete(
            node, servo.call_async(SetBool.Request(data=on)), timeout_sec=10.0)
    told = False
    future = None
    while time.monotonic() < until:
        rclpy.spin_once(node, timeout_sec=0.01)
        if future is None and client.service_is_ready():
            future = client.call_async(Trigger.Request())
        if not told and len(setpoints) > 50:
            told = True
            print('moving', flush=True)
        if future is not None and future.done():
            answer = future.result()
            if setpoints or not answer.message.startswith(UNREADY):
                break
            future = None
    until = time.monotonic() + 10.0
    while time.monotonic() < until and setpoints and setpoints[-1][1]:
        rclpy.spin_once(node, timeout_sec=0.01)
    print(json.dumps({'message': answer.message, 'setpoints': setpoints, 'feedback': feedback}),
          flush=True)


if __name__ == '__main__':
    home(sys.argv[1])
