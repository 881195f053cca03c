"""Refused messages are counted with their reasons, and warned of at most once a second for each topic."""

import pytest

from manta_sim_ros.nodes import refusals
from manta_sim_ros.nodes.refusals import Refusals, Refused


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(refusals.time, 'monotonic', lambda: now[0])
    return now


def test_each_is_counted_and_what_came_since_the_last_look_is_told_apart(clock):
    refused = Refusals(lambda line: None, 'current', 'the previous current continues')
    assert refused.take() == Refused(0, 0, '')
    for reason in ('vector.x is nan', 'vector.y is nan'):
        refused.add(ValueError(reason))
    assert refused.take() == Refused(2, 2, 'vector.y is nan')
    assert refused.take() == Refused(2, 0, 'vector.y is nan')


def test_the_first_is_warned_of_at_once_and_the_next_after_a_second(clock):
    lines = []
    refused = Refusals(lines.append, 'current', 'the previous current continues')
    for moment in (100.0, 100.5, 100.9, 101.0, 101.5, 102.1):
        clock[0] = moment
        refused.add(ValueError(f'at {moment}'))
    assert lines == [
        f'current refused, the previous current continues ({count} refused so far): at {moment}'
        for count, moment in ((1, 100.0), (4, 101.0), (6, 102.1))]


def test_a_topic_does_not_silence_another(clock):
    lines = []
    for topic in ('current', 'body_wrench'):
        Refusals(lines.append, topic, 'nothing changes').add(ValueError('why'))
    assert len(lines) == 2
