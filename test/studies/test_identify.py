"""`identify` finds hidden values within its intervals, says what the data cannot, and refuses wrong input in a line."""

import csv
import dataclasses
import os
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rclpy.serialization import serialize_message
from scipy.spatial.transform import Rotation
from std_msgs.msg import Float64MultiArray

from manta_sim_ros.dynamics import Parameters, Simulator, State
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.sensors import Imu, read_imu
from manta_sim_ros.studies import identify as command
from manta_sim_ros.studies.arguments import read_settings
from manta_sim_ros.studies.bag import BagReader, BagWriter
from manta_sim_ros.studies.commands import constant_gait
from manta_sim_ros.studies.design import design
from manta_sim_ros.studies.gaits import gaits_from
from manta_sim_ros.studies.identification import NotIdentifiableError, Problem, evaluate, identify
from manta_sim_ros.studies.identify import main
from manta_sim_ros.studies.measured import CHANNELS, COMMANDS, ORIENTATIONS, Run, Series, read_run
from manta_sim_ros.studies.replay import predicted
from manta_sim_ros.studies.simulate import simulate
from manta_sim_ros.studies.study import with_parameters

MODEL = Parameters().replace(fin={'chains': 4})
SETTINGS = Settings(model=MODEL)
TANK = MODEL.replace(solver={'fixed_base': True})
YAW, DRAG = 'body.quadratic_damping[5]', 'fin.drag_coefficient'
HIDDEN = {DRAG: 1.5, YAW: 2.0}
TURN, STRAIGHT = (30, 30, 0.6, 0.6, 40, 0), (30, 30, 0.6, 0.6, 40, 40)
BODY = {'position': 0.01, 'orientation': 0.01, 'twist': 0.01}
PLACED = Imu(position=(0.2, -0.1, 0.05), orientation=(0.1, -0.2, 3.0), acceleration_bias=(0.1, 0.2, -0.1),
             angular_velocity_bias=(0.01, -0.02, 0.03))


def planned(gait, deviations, duration=3.0, interval=0.1, shift=0.0):
    """Return a run whose samples are all zero."""
    time = shift + np.arange(round(duration / interval) + 1) * interval
    channels = {}
    for name, deviation in deviations.items():
        values = np.zeros((len(time), len(CHANNELS[name])))
        values[:, 3:] = name in ORIENTATIONS
        channels[name] = Series(time, values, np.full((len(time), 3 if name in ORIENTATIONS else values.shape[1]),
                                                      float(deviation)))
    return Run('run', ((0.0, gaits_from(gait)),), channels, PLACED)


def noisy(run, seed, known=True):
    random, channels = np.random.default_rng(seed), {}
    for name, series in run.channels.items():
        noise = random.normal(size=series.deviations.shape) * series.deviations
        turned = (Rotation.from_quat(series.values) * Rotation.from_rotvec(noise)).as_quat(
            ) if name in ORIENTATIONS else series.values + noise
        channels[name] = Series(series.time, turned, series.deviations if known else np.full(noise.shape, np.nan))
    return run._replace(channels=channels)


def measured(gait, deviations, seed, values=HIDDEN, model=MODEL, known=True, **options):
    clean, = predicted([planned(gait, deviations, **options)], with_parameters(model, values))
    return noisy(clean, seed, known)


def covered(result, values=HIDDEN):
    true = np.array([values[name] for name in result.names])
    return (result.intervals[:, 0] <= true) & (true <= result.intervals[:, 1])


def test_intervals_of_fifty_tank_tests_have_the_hidden_values_as_often_as_they_say():
    hidden = {DRAG: 1.5, 'fin.youngs_modulus': 1.5e8}
    clean, = predicted([planned(STRAIGHT, {'wrench': 0.5}, 1.5)], with_parameters(TANK, hidden))
    found = [identify([noisy(clean, seed)], list(hidden), TANK) for seed in range(50)]
    hits = np.sum([covered(result, hidden) for result in found], axis=0)
    assert all(45 <= count <= 50 for count in hits) and 0.90 <= hits.sum() / 100 <= 0.99, hits
    spread = np.std([result.estimates for result in found], axis=0) / np.mean([each.errors for each in found], axis=0)
    assert np.all((spread > 0.7) & (spread < 1.35))  # of 50 normal values, four standard errors


@pytest.fixture(scope='module')
def swims():
    return [measured(TURN, BODY, 1), measured((25, 15, 0.8, 0.8, 30, 30), BODY, 2)]


@pytest.fixture(scope='module')
def result(swims):
    return identify(swims, [DRAG, YAW], MODEL)


def test_hidden_values_of_noisy_swims_are_found(result):
    assert covered(result).all() and (result.errors < 0.2 * result.estimates).all()
    assert result.parameters == with_parameters(MODEL, dict(zip(result.names, result.estimates.tolist())))
    assert result.chi_square == pytest.approx(1.0, abs=0.15) and result.mixed == ''
    assert result.correlations[0, 1] == result.correlations[1, 0] and abs(result.correlations[0, 1]) < 0.95
    assert result.correlations.diagonal() == pytest.approx(1.0)


def test_a_gait_that_took_no_part_is_predicted_to_its_noise(result):
    other = measured((20, 35, 0.5, 0.5, 20, 50), BODY, 3, duration=6.0)
    before, after = (evaluate([other], parameters) for parameters in (MODEL, result.parameters))
    assert all(0.7 < value < 1.3 for values in after.weighted.values() for value in values)
    assert before.weighted['orientation'][2] > 2.0


def test_noise_that_is_not_known_is_estimated(swims, result):
    unknown = [run._replace(channels={name: each._replace(deviations=np.full(each.deviations.shape, np.nan))
                                      for name, each in run.channels.items()}) for run in swims]
    found = identify(unknown, [DRAG, YAW], MODEL)
    assert found.estimates == pytest.approx(result.estimates, rel=0.02)
    assert found.errors == pytest.approx(result.errors, rel=0.15)


def test_segments_do_not_pass_on_the_error_of_another_one(swims):
    run = swims[0]
    moved = run.channels['position'].values + np.where(run.channels['position'].time[:, None] >= 1.5, [5.0, 0, 0], 0.0)
    jumped = run._replace(channels={**run.channels, 'position': run.channels['position']._replace(values=moved)})
    found = identify([jumped], [DRAG, YAW], MODEL, segment=1.5)
    assert covered(found).all() and found.chi_square == pytest.approx(1.0, abs=0.2)
    assert evaluate([jumped], found.parameters).rms['position'][0] > 0.5  # one whole run cannot be simulated


@pytest.mark.parametrize('channels', [
    ['twist'], ['position', 'twist'], ['position', 'orientation'], ['angular_velocity', 'specific_force']])
def test_segments_begin_also_where_not_all_of_the_body_is_measured(channels):
    deviations = dict.fromkeys(channels, 0.003)
    swims = [measured(gait, deviations, seed, interval=0.05)
             for seed, gait in enumerate([TURN, (25, 15, 0.8, 0.8, 30, 30)])]
    found = identify(swims, [DRAG, YAW], MODEL, segment=1.5)
    assert covered(found).all() and found.chi_square == pytest.approx(1.0, abs=0.2)


def test_the_start_of_a_segment_acts_on_this_segment_alone_also_where_it_is_not_measured():
    problem = Problem([measured(TURN, {'position': 0.003}, 0)], [DRAG], MODEL, 1.0)
    speed_of_second = 1 + int(np.flatnonzero((problem._of_segment == 1) & (problem._coordinate == 6))[0])
    before, after = problem.errors([problem.start, problem.start + 0.1 * np.eye(len(problem.start))[speed_of_second]])
    changes = [np.abs(after - before)[problem.segments == segment].max() for segment in range(3)]
    assert changes[0] == 0.0 and changes[1] > 0.05 and changes[2] < 1e-3


@pytest.mark.parametrize('hidden', [0.0, 0.5, 3.0])
@pytest.mark.parametrize('start', [0.0, 1e-4, 0.1])
def test_a_parameter_is_found_wherever_the_search_begins_also_at_its_bound(hidden, start):
    damping = 'body.linear_damping[5]'
    swim = measured(TURN, BODY, 1, {damping: hidden})
    found = identify([swim], [damping], with_parameters(MODEL, {damping: start}))
    best = identify([swim], [damping], with_parameters(MODEL, {damping: hidden + 0.2}))
    assert found.chi_square == pytest.approx(best.chi_square, rel=1e-3) and covered(found, {damping: hidden}).all()
    assert found.estimates == pytest.approx(best.estimates, abs=0.1 * best.errors[0])


def test_a_run_that_begins_in_motion_has_the_forces_of_that_motion_from_its_first_sample_on():
    still = (0, 0, 0, 0, 0, 0)
    start = dataclasses.replace(State.at_rest(MODEL), twist=np.array([0.7, 0.0, 0.0, 0.0, 0.0, 0.0]))
    left, right = gaits_from(still)
    simulator = Simulator(MODEL, state=start)
    simulator.command(left=left, right=right)
    simulator.advance(0.5)
    states = [simulator.state, *(simulator.advance(0.1) for _ in range(10))]
    glide = planned(still, {'position': 1e-3, 'twist': 1e-3, 'specific_force': 1e-3, 'wrench': 1e-2}, 1.0)
    time = np.array([state.time - states[0].time for state in states])
    quiet = dataclasses.replace(PLACED, acceleration_noise=0.0)
    readings = [read_imu(quiet, MODEL, state).specific_force for state in states]
    exact = glide._replace(channels={
        name: glide.channels[name]._replace(time=time, values=np.array(values)) for name, values in {
            'position': [state.position for state in states], 'twist': [state.twist for state in states],
            'specific_force': readings, 'wrench': [state.fin_wrenches.sum(axis=0) for state in states]}.items()})
    fit = evaluate([exact], MODEL)
    assert abs(readings[0][0] - readings[-1][0]) > 0.01 < abs(states[0].fin_wrenches.sum(axis=0)[0])
    assert max(values.max() for values in fit.weighted.values()) < 1.0


@pytest.mark.parametrize(('free', 'options', 'said'), [
    ([], {}, 'no parameter is free, but at least one must be'),
    ([DRAG, YAW, DRAG], {}, f'{DRAG} is free twice, but must be once'),
    ([DRAG], {'segment': np.nan}, 'segment is nan s, but must be a finite number of at least'),
    ([DRAG], {'segment': np.inf}, 'segment is inf s, but must be a finite number of at least'),
    ([DRAG], {'segment': -1.0}, 'segment is -1 s, but must be a finite number of at least'),
    ([DRAG], {'runs': []}, 'there are no runs, but must be at least one'),
])
def test_what_cannot_be_identified_is_refused_with_value_and_bound(swims, free, options, said):
    with pytest.raises(ValueError, match=f'^{re.escape(said)}'):
        identify(options.pop('runs', swims), free, MODEL, **options)


@pytest.mark.parametrize(('free', 'options', 'said'), [
    ([], {}, 'no parameter is free'), ([DRAG], {'count': 0}, 'count is 0, but must be at least 1'),
    ([DRAG], {'duration': -2.0}, 'duration is -2 s, but must be a finite number of at least 0.1 s'),
    ([DRAG], {'duration': np.nan}, 'duration is nan s, but must be'),
])
def test_a_design_of_nothing_is_refused_with_value_and_bound(free, options, said):
    with pytest.raises(ValueError, match=f'^{re.escape(said)}'):
        design(free, MODEL, **{'count': 2, **options})


def test_samples_between_the_simulated_states_are_interpolated():
    model = MODEL.replace(solver={'time_step': 0.001})
    exact = measured(TURN, dict.fromkeys(BODY, 1e-12), 0, model=model, interval=0.05, shift=0.003)
    coarse = Problem([exact], (), with_parameters(model, HIDDEN))
    assert coarse.every == 0.01
    simulator = Simulator(with_parameters(model, HIDDEN))
    left, right = gaits_from(TURN)
    simulator.command(left=left, right=right)
    simulator.advance(0.003)
    states = [simulator.state, *(simulator.advance(0.05) for _ in range(60))]
    values = {name: coarse.simulated([coarse.start])[0][0][name] for name in BODY}
    for name, tolerance in (('position', 1e-4), ('orientation', 1e-4), ('twist', 1e-2)):
        assert values[name] == pytest.approx(np.array([getattr(state, name) for state in states]), abs=tolerance)


def test_the_specific_force_is_that_of_the_imu():
    run = measured(TURN, dict.fromkeys(['specific_force', 'angular_velocity', 'imu_orientation'], 0.0), 0, interval=0.5)
    simulator, still = Simulator(with_parameters(MODEL, HIDDEN)), dataclasses.replace(
        PLACED, acceleration_noise=0.0, angular_velocity_noise=0.0, orientation_noise=0.0)
    left, right = gaits_from(TURN)
    simulator.command(left=left, right=right)
    for index in range(1, 7):
        reading = read_imu(still, simulator.parameters, simulator.advance(0.5))
        for name in ('specific_force', 'angular_velocity'):
            assert run.channels[name].values[index] == pytest.approx(getattr(reading, name), abs=1e-9)
        assert run.channels['imu_orientation'].values[index] == pytest.approx(reading.orientation, abs=1e-9)


def test_parameters_that_only_act_as_a_product_are_named(swims):
    with pytest.raises(NotIdentifiableError, match=f'cannot tell {DRAG}, water.density apart'):
        identify([measured(STRAIGHT, {'wrench': 0.5}, 0, {DRAG: 1.5}, TANK)], [DRAG, 'water.density'], TANK)


def test_a_parameter_without_effect_is_named():
    with pytest.raises(NotIdentifiableError, match=r'say nothing about body\.quadratic_damping\[5\]: no sample'):
        identify([measured(STRAIGHT, {'wrench': 0.5}, 0, {}, TANK, duration=1.0)], [DRAG, YAW], TANK)


def test_hardly_different_parameters_are_named():
    names = ['body.drag_area[2]', 'body.quadratic_damping[2]', DRAG]
    model = with_parameters(MODEL, {YAW: 2.0, names[1]: 10.0})
    found = identify([measured(TURN, BODY, 0, {DRAG: 1.5}, model)], names, model)
    assert found.condition > 20.0 and found.mixed == f'{names[0]}, {names[1]}'
    assert f'the data hardly tell {names[0]}, {names[1]} apart' in '\n'.join(command.report(found))


def test_a_model_that_lacks_something_is_told_and_its_intervals_are_wider():
    run = measured(TURN, {'twist': 0.002}, 0)
    found, right = identify([run], [DRAG], MODEL), identify([run], [DRAG], with_parameters(MODEL, HIDDEN))
    assert found.chi_square > 4.0 and found.errors[0] > 1.5 * right.errors[0]
    assert ('the model lacks something' in '\n'.join(command.report(found))) > (
        'the model lacks something' in '\n'.join(command.report(right)))


def test_a_design_turns_to_learn_the_damping_in_yaw_and_says_how_well():
    proposed = design([DRAG, YAW], MODEL, 1, duration=3.0)
    (gait,) = proposed.gaits
    assert gait[0] != gait[1] or gait[4] != gait[5]
    found = Problem([planned(gait, BODY)], [DRAG, YAW], MODEL)
    part, = found.sensitivities(found.start)
    assert proposed.errors == pytest.approx(np.sqrt(np.diag(np.linalg.inv(part.T @ part))) * found.scales, rel=1e-3)


def write_table(path, run):
    """Write a run with one gait and with noise of 0.01 as a table."""
    columns = [(channel, CHANNELS[channel]) for channel in run.channels]
    deviations = [f'{name}_std' for channel, names in columns
                  for name in (names[:3] if channel in ORIENTATIONS else names)]
    gait = np.ravel([dataclasses.astuple(fin)[:3] for fin in run.commands[0][1]], order='F')
    with path.open('w', newline='') as file:
        table = csv.writer(file)
        table.writerow(['time', *COMMANDS[:6], *(name for _, names in columns for name in names), *deviations])
        for index, time in enumerate(run.channels['position'].time):
            table.writerow([time, *(gait if index == 0 else [''] * 6), *(
                value for channel, _ in columns for value in run.channels[channel].values[index]),
                *[0.01] * len(deviations)])
    return path


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'start.yaml').write_text('/**:\n  ros__parameters:\n    fin.chains: 4\n    publish_rate: 50.0\n')
    return tmp_path


def test_the_command_writes_a_file_that_the_node_takes_and_a_plot(folder, swims, capsys):
    for name, run in zip(('a.csv', 'b.csv'), swims):
        write_table(folder / name, run)
    main(['a.csv', '--free', f'{DRAG},{YAW}', '--config', 'start.yaml', '--validate', 'b.csv',
          '--output', 'fitted.yaml', '--plot', 'fitted.png'])
    out, errors = capsys.readouterr()
    assert 'condition number' in out and 'validation' in out and 'correlations' in out
    written = Parameters.from_yaml('fitted.yaml')
    expected = identify([read_run(folder / 'a.csv', SETTINGS)], [DRAG, YAW], MODEL)
    assert written == expected.parameters and covered(expected).all()
    assert read_settings(folder / 'fitted.yaml') == Settings().replace([('publish_rate', 50.0)]).replace(
        (name, Settings(model=written).value(name)) for name in Parameters.quantities())
    with Image.open('fitted.png') as image:
        assert len(image.getcolors(maxcolors=image.width * image.height)) > 50
    assert sorted(os.listdir()) == ['a.csv', 'b.csv', 'fitted.png', 'fitted.yaml', 'start.yaml']


def test_a_failure_while_writing_leaves_the_old_file(folder, swims, monkeypatch):
    write_table(folder / 'a.csv', swims[0])
    (folder / 'fitted.yaml').write_text('old')

    def fail(*_):
        raise OSError('no space is left')

    monkeypatch.setattr(Path, 'replace', fail)
    with pytest.raises(SystemExit) as ended:
        main(['a.csv', '--free', DRAG, '--config', 'start.yaml', '--output', 'fitted.yaml'])
    assert ended.value.code == 'identify: no space is left'
    assert (folder / 'fitted.yaml').read_text() == 'old'
    assert sorted(os.listdir()) == ['a.csv', 'fitted.yaml', 'start.yaml']


def test_the_estimates_are_written_before_the_plot(folder, swims, monkeypatch):
    write_table(folder / 'a.csv', swims[0])

    def fail(*_):
        raise OSError('no space is left')

    monkeypatch.setattr(command, 'plot', fail)
    with pytest.raises(SystemExit) as ended:
        main(['a.csv', '--free', DRAG, '--config', 'start.yaml', '--output', 'fitted.yaml', '--plot', 'fitted.png'])
    assert ended.value.code == 'identify: no space is left'
    assert Parameters.from_yaml('fitted.yaml').fin.drag_coefficient != MODEL.fin.drag_coefficient


def test_a_table_has_the_run_that_was_written(folder, swims):
    read = read_run(write_table(folder / 'a.csv', swims[0]), SETTINGS)
    assert read.commands == swims[0].commands and list(read.channels) == list(BODY)
    for name, series in swims[0].channels.items():
        for own, other in zip(read.channels[name], series):
            assert own == pytest.approx(other)


def test_a_bag_has_the_run_of_the_node_with_the_noise_that_it_says(folder):
    settings = Settings(model=with_parameters(MODEL, HIDDEN)).replace([('initial_yaw', 0.5)])
    simulate(settings, constant_gait(TURN, settings.model), 1.0, folder / 'bag')
    run = read_run(folder / 'bag', SETTINGS)
    assert run.commands == ((0.0, gaits_from(TURN)),)
    assert {name: len(series.time) for name, series in run.channels.items()} == {
        **dict.fromkeys(CHANNELS, 101), 'rod_angles': 51, 'rod_torques': 51}
    assert np.isnan(run.channels['twist'].deviations).all()
    assert run.channels['specific_force'].deviations == pytest.approx(0.02)
    exact, = predicted([run], settings.model)
    for name in ('position', 'orientation', 'twist', 'wrench', 'rod_angles', 'rod_torques'):
        assert exact.channels[name].values == pytest.approx(run.channels[name].values, abs=1e-9), name
    weighted = evaluate([run], settings.model).weighted
    assert all(0.7 < value < 1.3 for name in ('specific_force', 'angular_velocity') for value in weighted[name])


def write_bag(path, source, began, commands):
    """Write a part of another bag, and commands at times in s."""
    with BagReader(source) as whole, BagWriter(path, Settings()) as part:
        for topic in ('fin_command', 'joint_states', 'odom'):
            part.add_topic(topic, 10, keeps_last=False)
        for logged in whole.messages(['joint_states', 'odom']):
            if logged.time >= began * 1e9:
                part.write(logged.name, logged.time, logged.data)
        for time, values in commands:
            part.write('fin_command', round(time * 1e9), serialize_message(Float64MultiArray(data=values)))


def test_a_bag_counts_from_its_beginning_without_the_commands_that_the_node_refuses(folder):
    simulate(SETTINGS, [], 1.0, folder / 'whole')
    good = [0.5, 0.5, 0.6, 0.6, 0.7, 0.7]
    commands = [(0.4, [9.0] * 6), (0.5, []), (0.6, [0.1]), (0.7, good), (0.8, good)]
    write_bag(folder / 'part', folder / 'whole', 0.4, commands)
    (time, gaits), = read_run(folder / 'part', SETTINGS).commands
    assert time == pytest.approx(0.3) and [dataclasses.astuple(gait)[:3] for gait in gaits] == [(0.5, 0.6, 0.7)] * 2


def test_a_bag_that_begins_within_a_stroke_is_refused(folder):
    simulate(SETTINGS, constant_gait(STRAIGHT, MODEL), 0.6, folder / 'whole')
    write_bag(folder / 'late', folder / 'whole', 0.4, [(0.5, [0.5, 0.5, 0.6, 0.6, 0.7, 0.7])])
    with pytest.raises(ValueError, match=r'late: begins with a rod at 0\.\d+ rad, but the fins must be level'):
        read_run(folder / 'late', SETTINGS)


HEAD = 'time,A_l,A_r,f_l,f_r,phi_l,phi_r,u,v,w,p,q,r'
ROW = '0,0.5,0.5,0.6,0.6,0.7,0.7,0,0,0,0,0,0'


@pytest.mark.parametrize(('lines', 'said'), [
    ([''], "line 1: there is no column time"),
    (['time,speed'], "line 1: 'speed' is no name of a column, or is there twice"),
    ([f'{HEAD},u'], "line 1: 'u' is no name of a column, or is there twice"),
    ([HEAD.replace(',q', '')], 'line 1: there is no column q'),
    ([HEAD.replace(',u', '')], 'line 1: there is no column u'),
    ([HEAD.replace(',', ';'), ROW.replace(',', ';')], "is separated by ';', but must be by commas"),
    ([HEAD.replace(',', '\t'), ROW.replace(',', '\t')], "is separated by '\\t', but must be by commas"),
    ([HEAD, ROW, ROW.replace('0', '1e12', 1)], 'lasts 1e+12 s, but a run must last at most 3600 s'),
    ([HEAD.replace(',f_r', '')], 'line 1: there is no column f_r'),
    ([HEAD], 'has no measurement of position, orientation, twist,'),
    ([HEAD, '0,,,,,,,0,0,0,0,0,0'], 'has no command of the fins'),
    ([HEAD, f'{ROW},0'], 'line 2: there are 14 values, but must be 13'),
    ([HEAD, ROW.replace('0.6', 'x', 1)], "line 2: f_l is 'x', but must be a finite number"),
    ([HEAD, ROW.replace('0,0,0,0', '0,nan,0,0', 1)], "line 2: v is 'nan', but must be a finite number"),
    ([HEAD, ROW.replace('0,0,0,0', '0,,0,0', 1)], 'line 2: v is empty, but must be there with u'),
    ([HEAD, ROW, ROW], 'line 3: time is 0 s, but must be finite and more than 0 s'),
    ([HEAD, ROW.replace('0.5', '3', 1)], 'line 2: amplitude is 3.0, but must be from 0 to 1.5708 rad'),
    ([HEAD, ROW.replace('0.5', '1.2').replace('0.7', '3.1')], 'line 2: left amplitude 1.2 rad with phase 3.1 rad'),
    ([f'{HEAD},u_std', f'{ROW},0'], 'line 2: a standard deviation of twist is not more than 0'),
    ([HEAD.replace('u,v,w', 'qx,qy,qz,qw,u,v,w'), ROW.replace('0.7,0,', '0.7,0,0,0,0.9,0,')],
     'orientation has a quaternion whose norm is not 1'),
    (['"time"x'], 'is no table of comma-separated values'),
])
def test_a_wrong_table_is_refused_by_file_line_value_and_bound(folder, lines, said):
    (folder / 'run.csv').write_text('\n'.join(lines) + '\n')
    with pytest.raises(ValueError) as error:
        read_run(folder / 'run.csv', SETTINGS)
    assert str(error.value).startswith('run.csv') or str(error.value).startswith(str(folder / 'run.csv'))
    assert said in str(error.value)


@pytest.mark.parametrize(('arguments', 'said'), [
    (['run.csv'], 'the following arguments are required: --free'),
    (['--free', DRAG], 'there are no data'),
    (['run.csv', '--free', 'fin.drag_coef'], 'fin.drag_coef is no real number of the model; is fin.drag_coefficient'),
    (['run.csv', '--free', 'fin.chains'], 'fin.chains is no real number of the model'),
    (['run.csv', '--free', 'solver.time_step'], 'solver.time_step is no real number of the model'),
    (['run.csv', '--free', 'body.inertia'], 'must be one of body.inertia[0] to body.inertia[2]'),
    (['run.csv', '--free', 'body.inertia[3]'], 'must be one of body.inertia[0] to body.inertia[2]'),
    (['run.csv', '--free', f'{DRAG}[0]'], f'{DRAG}[0] is no single number, but must be {DRAG}'),
    (['run.csv', '--free', f'{DRAG},{DRAG}'], f'--free has {DRAG} twice'),
    (['none.csv', '--free', DRAG], "No such file or directory: 'none.csv'"),
    (['run.csv', '--free', DRAG, '--config', 'none.yaml'], 'No such file'),
    (['run.csv', '--free', DRAG, '--validate', 'none.csv'], "No such file or directory: 'none.csv'"),
    (['run.csv', '--free', DRAG, '--output', 'no/fitted.yaml'], '--output is no/fitted.yaml, but must be a .yaml file'),
    (['run.csv', '--free', DRAG, '--output', 'folder.yaml'], '--output is folder.yaml, but must be a .yaml file in'),
    (['run.csv', '--free', DRAG, '--config', 'start.yaml', '--output', './start.yaml'],
     '--output is start.yaml, but that is an input: it would be replaced'),
    (['run.csv', '--free', DRAG, '--plot', 'folder.png'], '--plot is folder.png, but must be a .png file in'),
    (['run.csv', '--free', f'{DRAG},'], f"--free is '{DRAG},', but must have a name before and after each comma"),
    (['run.csv', '--free', DRAG, '--channels', ''], "--channels is '', but must have a name before and after"),
    (['--free', DRAG, '--design', 'run.csv'], "is 'run.csv', but must be a whole number above 0 and at most 1000"),
    (['--free', DRAG, '--design', '--duration', '1e9'], "is '1e9', but must be a number above 0 and at most 3600"),
    (['run.csv', '--free', DRAG, '--plot', 'a.svg'], '--plot is a.svg, but must be a .png file'),
    (['run.csv', '--free', DRAG, '--channels', 'twist,speed'], '--channels has speed, but must have names of'),
    (['run.csv', '--free', DRAG, '--channels', 'wrench'], 'run.csv: has no measurement of wrench'),
    (['run.csv', '--free', DRAG, '--segment', '0'], "is '0', but must be a number above 0 and at most 3600"),
    (['run.csv', '--free', DRAG, '--segment', '0.01'],
     'segment is 0.01 s, but must be a finite number of at least 0.2 s'),
    (['run.csv', '--free', DRAG, '--design', '--output', 'a.yaml'], '--output does not go with --design'),
    (['.', '--free', DRAG], '.: cannot be read as a bag'),
])
def test_wrong_arguments_are_refused_with_status_2_and_one_line(folder, arguments, said, capsys):
    lines = [f'{time},,,,,,,{time},0,0,0,0,0' for time in (0.1, 0.2, 0.3)]
    (folder / 'run.csv').write_text('\n'.join([HEAD, ROW, *lines, '']))
    (folder / 'folder.png').mkdir()
    (folder / 'folder.yaml').mkdir()
    with pytest.raises(SystemExit, match='^2$'):
        main(arguments)
    out, errors = capsys.readouterr()
    line, = errors.splitlines()
    assert not out and line.startswith('identify: ') and said in line
    assert sorted(os.listdir()) == ['folder.png', 'folder.yaml', 'run.csv', 'start.yaml']


def test_each_bag_of_a_killed_recorder_is_named_in_a_line(folder, capsys):
    simulate(SETTINGS, constant_gait(STRAIGHT, MODEL), 0.2, folder / 'whole')
    for name in ('a', 'b'):
        (folder / f'{name}.mcap').write_bytes(next((folder / 'whole').glob('*.mcap')).read_bytes()[:-1])
    with pytest.raises(SystemExit, match='^2$'):
        main(['a.mcap', 'b.mcap', 'none.csv', '--free', DRAG, '--config', 'start.yaml'])
    a, b, none = capsys.readouterr().err.splitlines()
    assert 'identify: a.mcap: has no end' in a and 'identify: b.mcap: has no end' in b and 'none.csv' in none


def test_what_the_data_cannot_say_ends_with_status_1_and_one_line(folder, capsys):
    write_table(folder / 'a.csv', measured(STRAIGHT, BODY, 0, {}, TANK, duration=1.0))
    (folder / 'start.yaml').write_text('/**:\n  ros__parameters: {fin.chains: 4, solver.fixed_base: true}\n')
    with pytest.raises(SystemExit) as ended:
        main(['a.csv', '--free', YAW, '--config', 'start.yaml', '--output', 'fitted.yaml'])
    assert ended.value.code == f'identify: the data say nothing about {YAW}: no sample depends on it'
    assert not (folder / 'fitted.yaml').exists()
