"""The page of a swim shows what is in the bag, says what is missing, and moves when the slider is dragged."""

import base64
import html
import http.server
import json
import math
import queue
import re
import shutil
import subprocess
import sys
import threading

import numpy as np
import pytest
from PIL import Image
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from evidence.harness import recorder
from evidence.harness.processes import LIMIT, command_of
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, fin_surfaces
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.studies.bag import TYPES
from manta_sim_ros.studies.commands import constant_gait
from manta_sim_ros.studies.curves import facts, moving_mean, panels
from manta_sim_ros.studies.recorded_swim import read_swim
from manta_sim_ros.studies.report import MOST_FRAMES, frame_times, html_page, main, notes, write_report
from manta_sim_ros.studies.scene import body, fins
from manta_sim_ros.studies.simulate import simulate

BROWSER = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'google-chrome'))), None)
GAIT = [0.7, 0.4, 0.6, 0.5, 0.7, 0.3]
CHAINS, LINKS = 5, 2
MODEL = Parameters().replace(fin={'chains': CHAINS, 'links': LINKS})
DURATION = 2.0  # s
WITH_JOINTS = Settings(model=MODEL).replace([('publish_fin_joints', True), ('joint_state_rate', 100.0)])


def gait():
    degrees = np.degrees(GAIT)
    degrees[2:4] = GAIT[2:4]
    return constant_gait(degrees.tolist(), MODEL)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('bags') / 'run'
    simulate(WITH_JOINTS, gait(), DURATION, path, markers=True)
    return path


@pytest.fixture(scope='module')
def swim(bag):
    return read_swim(bag)


@pytest.fixture
def without(bag, tmp_path):
    """Return a function that copies the bag without some topics."""
    def copy(*topics):
        with Reader(bag) as reader, Writer(
                tmp_path / 'part', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            kept = {each.id: writer.add_connection(each.topic, each.msgtype, typestore=TYPES)
                    for each in reader.connections if each.topic not in topics}
            for connection, time, data in reader.messages():
                if connection.id in kept:
                    writer.write(kept[connection.id], time, data)
        return tmp_path / 'part'

    return copy


def test_a_swim_has_the_states_of_the_simulator(swim):
    simulator = Simulator(MODEL)
    simulator.command(left=FinCommand(*GAIT[0::2]), right=FinCommand(*GAIT[1::2]))
    assert swim.settings == WITH_JOINTS
    assert len(swim.time) == len(swim.joints.time) == len(swim.wrench_time) == 1 + DURATION * 100
    for k in range(1, len(swim.time)):
        state = simulator.advance(0.01)
        assert swim.time[k] == pytest.approx(state.time, abs=1e-9)
        for part, expected in (
                (swim.position, state.position), (swim.orientation, state.orientation), (swim.twist, state.twist),
                (swim.wrench, state.wrench), (swim.joints.rod_angles, state.rod_angles),
                (swim.joints.joint_angles, state.joint_angles)):
            assert np.allclose(part[k], expected, rtol=0.0, atol=1e-9)  # of degrees and back
        assert swim.joints.power[k] == pytest.approx(state.rod_power, abs=1e-9)
    (part, _) = fins(swim, swim.time[-1:])
    nodes = fin_surfaces(MODEL, state.rod_angles, state.joint_angles)[0]
    assert np.allclose(part.points.reshape(CHAINS, LINKS + 2, 3)[:, 1:], nodes, atol=1e-9)
    assert np.allclose(part.angles.reshape(CHAINS, LINKS + 2)[:, -1], np.degrees(state.joint_angles[0].sum(axis=-1)))
    assert (swim.gait_time.tolist(), swim.gaits.tolist()) == ([0.0], [pytest.approx(GAIT)])


def test_the_fins_of_joints_and_of_markers_are_the_same(swim, without):
    of_markers = read_swim(without('/joint_states'), WITH_JOINTS)
    for joints, markers in zip(fins(swim, np.array([1.0])), fins(of_markers, np.array([1.05]))):
        links, shown = joints.points.reshape(CHAINS, LINKS + 2, 3)[:, 1:].reshape(-1, 3), corners(markers.points[0])
        assert corners(links) < shown < corners(joints.points[0])  # these also have the panel at each chain


def corners(points):
    return {tuple(point) for point in points.round(9)}


def test_every_triangle_of_the_body_and_the_fins_has_neighbors_as_corners(swim):
    for part, longest in ((body(), 0.3), *((fin, 0.4) for fin in fins(swim, swim.time[:1]))):
        corners = part.points[0][part.triangles]
        assert np.ptp(corners, axis=1).max() < longest
        assert set(part.triangles.ravel()) == set(range(part.points.shape[1]))


def test_the_curves_have_names_and_the_mean_is_that_of_the_window(swim):
    titles = [panel.title for panel in panels(swim)]
    assert {'Velocity', 'Attitude', 'Force of the fins', 'Moment of the fins', 'Rods', 'Torque of the rods',
            'Power of the rods', 'Cost of transport', 'Commanded angles', 'Commanded frequency'} <= set(titles)
    time = np.linspace(0.0, 10.0, 1001)
    assert np.allclose(moving_mean(time, np.cos(np.pi * time))[200:], 0.0, atol=1e-3)
    assert np.allclose(moving_mean(time, 2.0 * time)[200:], 2.0 * time[200:] - 2.0)
    assert moving_mean(time, time)[50] == pytest.approx(0.25)


def test_the_numbers_of_the_whole_swim_are_its_means(swim):
    found = facts(swim)
    assert found['Duration'] == '2.00 s'
    speed, power = float(found['Mean forward speed'].split()[0]), float(found['Mean power'].split()[0])
    assert speed == pytest.approx(swim.twist[:, 0].mean(), rel=0.02) and power == pytest.approx(
        swim.joints.power.mean(), rel=0.02)
    assert float(found['Cost of transport']) == pytest.approx(power / (20.0 * 9.81 * speed), rel=0.02)


def test_a_page_needs_no_network_and_lacks_nothing(swim):
    page = html_page(swim, '<run>')
    assert notes(swim) == [] and 'class="note"' not in page
    assert re.findall(r'<(?:script|link|img|iframe)[^>]*(?:src|href)=', page) == []
    assert '&lt;run&gt;, from 0.00 s to 2.00 s, 51 frames' in page
    data = json.loads(re.search(r'<script id="swim" type="application/json">(.*?)</script>', page)[1])
    position = np.frombuffer(base64.b64decode(data['position']), np.float32).reshape(-1, 3)
    assert np.array_equal(position[-1], swim.position[-1].astype(np.float32)) and len(data['time']) == 51
    assert data['gait'][0] == 'left / right: A 40.1 / 22.9°, f 0.6 / 0.5 Hz, φ 40.1 / 17.2°'


def test_a_long_swim_has_no_more_frames():
    class Long:
        time = np.arange(0.0, 100.0, 0.01)

    times = frame_times(Long)
    assert len(times) == MOST_FRAMES and times[-1] == Long.time[-1] and np.ptp(np.diff(times)) < 0.011


@pytest.mark.parametrize(('topics', 'said'), [
    (['/joint_states', '/fin_markers'], 'The bag has no joint_states: rods, power and fins are missing.'),
    (['/joint_states'], 'The bag has no joint_states: rods and power are missing. The fins are those of fin_markers.'),
    (['/fin_wrench'], 'The bag has no fin_wrench.'),
    (['/fin_command'], 'The bag has no fin_command: the gait is not known.'),
])
def test_what_the_bag_lacks_is_said_in_the_page(without, topics, said):
    swim = read_swim(without(*topics), WITH_JOINTS)
    assert notes(swim) == [said]
    assert f'<p class="note">{html.escape(said)}</p>' in html_page(swim, 'run')


def test_fins_without_joints_are_drawn_stiff_and_that_is_said(tmp_path):
    simulate(Settings(model=MODEL), gait(), 0.5, tmp_path / 'run')
    swim = read_swim(tmp_path / 'run')
    (note,) = notes(swim)
    assert note.startswith('The bag has neither the joints of the fins nor fin_markers: the fins are drawn stiff.')
    (part, _) = fins(swim, swim.time[-1:])
    (_, inner, tip) = part.points.reshape(CHAINS, LINKS + 2, 3)[0, 1:]
    root = part.points.reshape(CHAINS, LINKS + 2, 3)[0, 1]
    assert np.allclose(tip - root, 2.0 * (inner - root)) and part.angles is None


def test_joint_states_without_torques_are_left_out(bag, without, tmp_path):
    name, kind = '/joint_states', 'sensor_msgs/msg/JointState'
    with Reader(bag) as reader, Writer(tmp_path / 'bare', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {each.topic: writer.add_connection(each.topic, each.msgtype, typestore=TYPES)
                  for each in reader.connections}
        for connection, time, data in reader.messages():
            if connection.topic == name:
                message = TYPES.deserialize_cdr(data, kind)
                message.effort = message.effort[:0]
                data = TYPES.serialize_cdr(message, kind)
            writer.write(topics[connection.topic], time, data)
    assert read_swim(tmp_path / 'bare', WITH_JOINTS).joints is None


def test_parameters_of_another_version_are_named(bag, tmp_path):
    shutil.copytree(bag, tmp_path / 'old')
    metadata = tmp_path / 'old' / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('"fin.span"', '"fin.gone"'))
    with pytest.raises(ValueError, match='old: its parameters are not those of this version: .*gone'):
        read_swim(tmp_path / 'old')


def test_other_numbers_of_chains_than_the_parameters_have_are_refused(without):
    with pytest.raises(ValueError, match=r'part: has fins of 5 chains and 2 links, but the parameters have 30 and 3: '):
        read_swim(without('/fin_markers'))


def test_a_bag_that_a_recorder_of_the_running_node_wrote_gives_a_page(launch, probe, tmp_path):
    path, log = tmp_path / 'live.mcap', tmp_path / 'live.log'
    topics = [f'/live/{name}' for name in ('odom', 'fin_wrench', 'joint_states', 'clock')]
    queues = ' '.join(f'-p qos_overrides.{topic}.publisher.depth:=1000' for topic in topics)  # so that none is lost
    launch('sim_node', f'-r __ns:=/live -r /clock:=/live/clock {queues}')
    with log.open('wb') as file:
        process = subprocess.Popen(
            [sys.executable, recorder.__file__, path, *topics], stdin=subprocess.DEVNULL, stdout=file)
    try:
        probe.until(lambda: process.poll() is not None or all(
            log.read_text().count(f'{topic} ') > 50 for topic in topics), 'messages of each topic')
    finally:
        process.terminate()
        process.wait(LIMIT)
    assert process.returncode == 0
    swim = read_swim(path)
    assert len(swim.time) > 20 and np.allclose(np.diff(swim.time), 0.01)
    write_report(swim, tmp_path / 'live.html', 'live')
    assert 'drawn stiff' in (tmp_path / 'live.html').read_text('utf-8')


def test_a_bag_of_a_killed_recorder_gives_a_page_and_one_line(bag, tmp_path, capsys):
    (file,) = bag.glob('*.mcap')
    cut, config = tmp_path / 'killed.mcap', tmp_path / 'chains.yaml'
    cut.write_bytes(file.read_bytes()[:-1])
    config.write_text(f'/manta_sim:\n  ros__parameters: {{fin.chains: {CHAINS}, fin.links: {LINKS}}}\n')
    main([str(cut), '--output', str(tmp_path / 'page.html'), '--config', str(config)])
    assert capsys.readouterr().err == (
        f'report: {cut}: has no end, as if its recorder was killed or still runs: it is read up to its last whole '
        'chunk\n')
    assert 'killed.mcap' in (tmp_path / 'page.html').read_text('utf-8')


def test_a_picture_for_print_is_drawn(bag, tmp_path):
    main([str(bag), '--output', str(tmp_path / 'made' / 'run.png'), '--format', 'png'])
    with Image.open(tmp_path / 'made' / 'run.png') as image:
        assert image.width == 936  # 7.2 inches
        assert len(image.convert('RGB').getcolors(maxcolors=image.width * image.height)) > 50


@pytest.mark.parametrize(('part', 'name', 'value'), [
    ('position', 'y', math.nan), ('position', 'x', math.inf), ('orientation', 'w', math.nan), ('orientation', 'w', 0.0),
])
def test_an_odometry_without_a_pose_is_refused(part, name, value, bag, tmp_path):
    kind = 'nav_msgs/msg/Odometry'
    with Writer(tmp_path / 'bad', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        odom = writer.add_connection('/odom', kind, typestore=TYPES)
        with Reader(bag) as reader:
            of_bag = [each for each in reader.connections if each.topic == '/odom']
            for number, (_, time, data) in zip(range(2), reader.messages(of_bag)):  # the robot begins level
                message = TYPES.deserialize_cdr(data, kind)
                if number == 0:
                    setattr(getattr(message.pose.pose, part), name, value)
                writer.write(odom, time, TYPES.serialize_cdr(message, kind))
    with pytest.raises(ValueError, match='bad: has an odom whose position is not finite, or whose orientation has no'):
        read_swim(tmp_path / 'bad')


@pytest.mark.parametrize(('arguments', 'said'), [
    (['none', '--output', 'page.html'], 'none: cannot be read as a bag'),
    (['still', '--output', 'page.html'], 'still: has 1 messages on odom, but must have at least 2'),
    (['run'], 'the following arguments are required: --output'),
    (['run', '--output', 'there.html'], 'there.html exists, but the output must be new'),
    (['run', '--output', 'page.html', '--namespace', '/other'], 'run: has none of the topics /other/odom'),
    (['run', '--output', 'page.html', '--config', 'none.yaml'], 'none.yaml'),
    (['run', '--output', 'page.pdf', '--format', 'pdf'], "invalid choice: 'pdf'"),
])
def test_wrong_input_ends_with_status_2_and_one_line(bag, tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'there.html').touch()
    (tmp_path / 'run').symlink_to(bag)
    with Writer(tmp_path / 'still', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        odom = writer.add_connection('/odom', 'nav_msgs/msg/Odometry', typestore=TYPES)
        with Reader(bag) as reader:
            of_bag = [each for each in reader.connections if each.topic == '/odom']
            writer.write(odom, 0, next(reader.messages(of_bag))[2])
    with pytest.raises(SystemExit, match='^2$'):
        main(arguments)
    out, errors = capsys.readouterr()
    (line,) = errors.splitlines()
    assert out == '' and line.startswith('report: ') and said in line
    assert not (tmp_path / 'page.html').exists()


def test_the_command_writes_a_page(bag, tmp_path):
    ended = subprocess.run([*command_of('report'), bag, '--output', tmp_path / 'page.html'], capture_output=True,
                           text=True, timeout=LIMIT)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, '', '')
    assert (tmp_path / 'page.html').read_text('utf-8').startswith('<!DOCTYPE html>')


CATCH = """<script>
const errors = [];
console.error = (...words) => errors.push(words.join(' '));
window.addEventListener('error', event => errors.push(event.message));
window.addEventListener('unhandledrejection', event => errors.push(String(event.reason)));
</script>"""

DRAG = """<script>
const wait = ms => new Promise(resolve => setTimeout(resolve, ms));
const seen = () => ({
  frame: document.body.dataset.frame, time: document.getElementById('time').textContent,
  cursor: curves.layout.shapes[0].x0, path: Array.from(path.data[0].x).slice(0, 1)[0],
  fin: Array.from(robot.data[1].z), gait: document.getElementById('gait').textContent,
  views: [...document.querySelectorAll('canvas')].length});
async function shown(frame) {
  while (document.body.dataset.frame !== String(frame)) await wait(50);
  return seen();
}
async function drag() {
  const found = {first: await shown(0)};
  slider.value = 40;
  slider.dispatchEvent(new Event('input'));
  found.dragged = await shown(40);
  document.getElementById('speed').value = 5;
  play.click();
  found.label = play.textContent;
  found.last = await shown(slider.max);
  while (playing) await wait(50);
  found.end = play.textContent;
  found.errors = errors;
  await fetch('/found', {method: 'POST', body: JSON.stringify(found)});
}
drag();
</script></body>"""


class Server(http.server.ThreadingHTTPServer):
    """Gives a page to a browser, and takes what it found."""

    def __init__(self, page):
        super().__init__(('127.0.0.1', 0), self.Handler)
        self.page, self.asked, self.found = page.encode(), [], queue.Queue()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.server.asked.append(self.path)
            self._answer(self.server.page if self.path == '/' else b'')

        def do_POST(self):
            self.server.found.put(json.loads(self.rfile.read(int(self.headers['Content-Length']))))
            self._answer(b'')

        def _answer(self, body):
            self.send_response(200)
            self.send_header('Content-Type', 'text/html; charset=utf-8')
            self.send_header('Content-Length', str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass


@pytest.mark.skipif(BROWSER is None, reason='there is no Chromium')
def test_the_pose_and_the_cursor_follow_the_slider_and_the_play_button_without_an_error(swim, tmp_path):
    page = html_page(swim, 'run').replace('<head>', f'<head>{CATCH}', 1).replace('</body>', DRAG)
    with Server(page) as server, (tmp_path / 'log').open('wb') as log:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = subprocess.Popen([
            BROWSER, '--headless', '--no-sandbox', '--disable-dev-shm-usage', '--enable-unsafe-swiftshader',
            '--use-angle=swiftshader', f'--user-data-dir={tmp_path / "profile"}', '--window-size=1200,800',
            '--remote-debugging-port=0', f'http://127.0.0.1:{server.server_port}/',
        ], stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            found = server.found.get(timeout=LIMIT)
        finally:
            browser.terminate()
            browser.wait()
            server.shutdown()
        assert set(server.asked) <= {'/', '/favicon.ico'}
    assert found['errors'] == []
    frames = frame_times(swim)
    for name, frame in (('first', 0), ('dragged', 40), ('last', 50)):
        shown, index = found[name], np.searchsorted(swim.time, frames[frame])
        assert shown['time'] == f'{frames[frame]:.2f} s' and shown['cursor'] == pytest.approx(frames[frame], abs=1e-6)
        (expected, _) = fins(swim, frames[frame:frame + 1])
        rotation = quaternion_matrix(swim.orientation[index])
        assert shown['fin'] == pytest.approx((expected.points[0] @ rotation.T)[:, 2], abs=1e-5)
        nose = swim.position[index] + rotation @ body().points[0, 0]
        assert shown['path'] == pytest.approx(nose[0], abs=1e-5)
    assert found['first']['views'] > 0 and found['dragged']['gait'].startswith('left / right: A 40.1 / 22.9°')
    assert (found['label'], found['end']) == ('Pause', 'Play')


def quaternion_matrix(quaternion):
    """Return the rotation matrix of a unit quaternion, written out."""
    x, y, z, w = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
