# SPDX-License-Identifier: Apache-2.0
"""The layouts for Foxglove and PlotJuggler name topics and fields that a record has."""

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from core_rig import rig
from record_rig import Recorded

from homing_node.recording import reading
from homing_node.recording.folder import RecordFolder

CONFIG = Path(__file__).resolve().parent.parent / 'config'


@pytest.fixture(scope='module')
def contents(tmp_path_factory):
    """What a record of a run has."""
    folder = tmp_path_factory.mktemp('records')
    recorded = Recorded(rig('HSHS').rehearsal(), RecordFolder(folder, '/homing_node', 5, 5))
    recorded.home()
    (file,) = folder.glob('*.mcap')
    return reading.contents(file)


def value_of(message, path):
    """Return what a path such as `points[0].positions[0]` names in a message."""
    for name, _, place in re.findall(r'(\w+)(\[(\d+)\])?', path):
        message = getattr(message, name)
        if place:
            message = message[int(place)]
    return message


def named(contents, path):
    """Return the values that a path `/topic.field` names in the messages of a record."""
    topic, _, field = path.partition('.')
    return [value_of(one.message, field) for one in contents.topics[topic]]


def test_foxglove(contents):
    layout = json.loads((CONFIG / 'foxglove.json').read_text())
    panels = layout['configById']
    paths = [one['value'] for panel in panels.values() for one in panel.get('paths', [])]
    paths += [panel['topicPath'] for panel in panels.values() if 'topicPath' in panel]
    assert len(paths) >= 10
    for path in paths:
        assert named(contents, path), path
    shown = set(re.findall(r'"([A-Z]\w+!\w+)"', json.dumps(layout['layout'])))
    assert shown == set(panels)
    assert named(contents, '/homing_node/x/home_switch.data') == [False, True, False, True]


def test_plotjuggler(contents):
    """PlotJuggler writes `/` between the fields, and a joint state by the name of its joint."""
    tree = ElementTree.parse(CONFIG / 'plotjuggler.xml')
    curves = [one.get('name') for one in tree.iter('curve')]
    assert len(curves) >= 8
    for curve in curves:
        joint = re.fullmatch(r'(/joint_states)/(\w+)/position', curve)
        if joint:
            messages = contents.topics[joint[1]]
            assert {joint[2]} == {name for one in messages for name in one.message.name}
            continue
        topic = max((t for t in contents.topics if curve.startswith(f'{t}/')), key=len)
        field = curve.removeprefix(f'{topic}/').replace('/', '.')
        for value in named(contents, f'{topic}.{field}'):
            assert isinstance(value, bool | int | float), curve
