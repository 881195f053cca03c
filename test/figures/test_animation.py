"""Animations: a GIF plays its gait in real time, and what is drawn is where the record says."""

import io

import numpy as np
import pytest
from PIL import Image

from evidence.references.equations import orientation_matrix
from evidence.scenarios import run_python
from manta_sim_ros.dynamics import fin_surfaces
from manta_sim_ros.figures.animation import ANIMATIONS, FRAMES, animate, palette
from manta_sim_ros.figures.gaits import TURNS, robot
from manta_sim_ros.figures.record import record
from manta_sim_ros.figures.scene import Scene, in_world

FEW = 7


@pytest.fixture(scope='module', params=ANIMATIONS)
def played(request):
    """Name of an animation, its first frames as an image, and how often `done` was called."""
    target, calls = io.BytesIO(), []
    animate(request.param, target, lambda: calls.append(None), frames=FEW)
    with Image.open(target) as image:
        yield request.param, image, len(calls)


@pytest.fixture(scope='module')
def turn():
    """Two periods of the turn with a different phase of each fin."""
    return record(robot(), *TURNS['set 1'], 2, ANIMATIONS['turn_set_1'].samples)


def test_a_gif_has_the_frames_asked_for_and_done_is_called_after_each(played):
    _, image, calls = played
    assert image.format == 'GIF'
    assert image.n_frames == calls == FEW


def test_a_gif_plays_in_real_time_again_and_again(played):
    name, image, _ = played
    durations = []
    for frame in range(FEW):
        image.seek(frame)
        durations.append(image.info['duration'])
    between = 1000.0 / (ANIMATIONS[name].samples * ANIMATIONS[name].left.frequency)
    simulated = between * np.arange(1, FEW + 1)
    np.testing.assert_allclose(np.cumsum(durations), simulated, rtol=0.0, atol=5.0)  # [ms], half a hundredth
    assert image.info['loop'] == 0


def test_all_animations_last_as_long():
    lasting = [FRAMES / (animation.samples * animation.left.frequency) for animation in ANIMATIONS.values()]
    assert lasting == pytest.approx([15.0] * 3)


def test_both_views_change_in_every_frame(played):
    _, image, _ = played
    pictures = []
    for frame in range(FEW):
        image.seek(frame)
        below_the_clock = np.asarray(image.convert('RGB'))[image.height // 6:]
        pictures.append(np.split(below_the_clock, 2, axis=1))
    for before, after in zip(pictures, pictures[1:]):
        for view_before, view_after in zip(before, after):
            assert (view_before != view_after).any(axis=-1).mean() > 1e-3


def test_the_fins_are_drawn_where_the_record_has_them(turn):
    nodes = fin_surfaces(turn.parameters, turn.rod_angles, turn.joint_angles)
    scene = Scene.of(turn)
    for i in range(len(turn.time)):
        rotation = orientation_matrix(turn.orientation[i])
        for side in 0, 1:
            expected = nodes[i, side].reshape(-1, 3) @ rotation.T + turn.position[i]
            distances = np.linalg.norm(scene.faces[i].reshape(-1, 1, 3) - expected[:, None].swapaxes(0, 1), axis=-1)
            assert distances.min(axis=0).max() < 1e-13


def test_a_point_of_the_body_frame_goes_with_the_pose(turn):
    tips = fin_surfaces(turn.parameters, turn.rod_angles, turn.joint_angles)[:, 0, 0, -1]
    assert np.abs(turn.orientation[-1, 2]) > 0.1  # it has turned
    expected = orientation_matrix(turn.orientation[-1]) @ tips[-1] + turn.position[-1]
    np.testing.assert_allclose(in_world(turn, tips)[-1], expected, rtol=0.0, atol=1e-14)


def test_a_gif_holds_every_color_of_the_robot(turn):
    scene = Scene.of(turn)
    held = np.frombuffer(palette(scene), dtype=np.uint8).reshape(-1, 3)
    assert len(held) <= 256
    assert set(map(tuple, np.round(255.0 * scene.colors).astype(int).reshape(-1, 3))) <= set(map(tuple, held))


def test_a_title_has_what_differs_of_left_and_right_twice():
    assert ANIMATIONS['straight'].title == 'Straight:  A = 40°,  f = 0.6 Hz,  φ = 40°'
    assert ANIMATIONS['turn_set_1'].title.endswith('A = 40°,  f = 0.8 Hz,  φ = 40° / 0°')
    assert ANIMATIONS['turn_set_2'].title.endswith('A = 40° / 20°,  f = 0.8 Hz,  φ = 40°')


def test_an_unknown_animation_is_refused_with_the_names_of_all():
    with pytest.raises(ValueError, match="'loop'.* straight, turn_set_1, turn_set_2"):
        animate('loop', io.BytesIO())


def test_matplotlib_is_imported_only_to_draw(tmp_path):
    run_python('import sys, manta_sim_ros.figures.animation\nassert "matplotlib" not in sys.modules', tmp_path)
