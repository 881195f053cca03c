"""A small version of each part of `make soak`, and the page that the long one wrote."""

import random
import types
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('hypothesis')
pytest.importorskip('mcap')

from evidence.report import read_table  # noqa: E402
from evidence.soak import fuzz, page  # noqa: E402
from evidence.soak.__main__ import main  # noqa: E402
from evidence.soak.facts import SHORT, Lengths, at_most, equal, printed  # noqa: E402
from manta_sim_ros.nodes import messages  # noqa: E402
from manta_sim_ros.nodes.interface import TOPICS  # noqa: E402

PAGE = (Path(__file__).parents[2] / 'docs' / 'reliability.md').read_text(encoding='utf-8')
TAKEN = {
    'fin_command': lambda message: messages.fin_commands(message.data),
    'rod_command': lambda message: messages.rod_command(message, np.zeros((2, 2))),
    'set_pose': lambda message: messages.pose_of(message, 'odom'),
    'initialpose': lambda message: messages.planar_pose_of(message, 'odom', 0.0),
    'current': lambda message: messages.current_of(message, 'odom'),
    'body_wrench': lambda message: messages.wrench_of(message, 'base_link', 'odom')}


def on_the_page(part):
    """Return the rows of the table of a part."""
    return read_table(PAGE[PAGE.index(f'\n## {part.TITLE}\n'):])[1:]


@pytest.mark.parametrize('name', page.PARTS)
def test_every_fact_of_the_small_version_holds_and_stands_on_the_page(name):
    part = page.PARTS[name]
    facts = part.measure(SHORT)
    assert not [fact for fact in facts if not fact.holds]
    assert {fact.name for fact in facts} <= {row[0] for row in on_the_page(part)}


@pytest.mark.parametrize('name', page.PARTS)
def test_every_expectation_on_the_page_was_met(name):
    rows = on_the_page(page.PARTS[name])
    assert sum(bool(expected) for _, _, expected, _ in rows) > 2
    assert all(holds == ('yes' if expected else '') for _, _, expected, holds in rows)
    assert f'make soak PARTS={name}`' in PAGE


def test_a_part_that_falls_over_makes_the_command_fail_after_its_table_is_printed(monkeypatch, capsys):
    def broken(lengths):
        raise RuntimeError('the node\nended')

    parts = {'broken': types.SimpleNamespace(TITLE='Broken', measure=broken),
             'sound': types.SimpleNamespace(TITLE='Sound', measure=lambda lengths: [printed('number', 3)])}
    monkeypatch.setattr(page, 'PARTS', parts)
    assert main(['--short']) == 1
    assert '| the part ran to its end | RuntimeError: the node ended | yes | **no** |' in capsys.readouterr().out
    assert main(['--short', 'sound']) == 0
    assert '| number | 3 |  |  |' in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(['--short', 'no_part'])


def test_parts_that_were_not_run_stay_on_the_page():
    facts = {name: [equal(name, 1, 1)] for name in page.PARTS}
    before = page.text(facts, 'a machine')
    after = page.text({'load': [at_most('new', 2.0, 1.0)]}, 'another', before)
    assert '| new | 2 | at most 1 | **no** |' in after and '| load |' not in after
    assert '| fuzz | 1 | 1 | yes |' in after and after.count('\n## ') == len(page.PARTS)


@pytest.mark.parametrize('topic', [topic for topic, about in TOPICS.items() if about.direction == 'in'])
def test_the_fuzzer_knows_which_of_its_messages_must_be_refused(topic):
    chance, hostile, take = random.Random(1), 0, TAKEN.get(topic)
    for _ in range(300):
        message = fuzz.valid(topic, chance)
        worse, refused = fuzz.broken(topic, message, chance)
        hostile += refused
        if take is not None:
            take(message)
            if refused:
                with pytest.raises(ValueError):
                    take(worse)
    assert 50 < hostile < 300


def test_the_lengths_of_the_long_run_are_those_that_were_asked_for():
    assert Lengths().inputs == 100_000 and Lengths().simulated == 24 * 3600 and Lengths().node == 3600
    assert Lengths().starts == 200 and Lengths().stop == 10
