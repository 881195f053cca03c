from glob import glob
from xml.etree import ElementTree  # nosec B405 # for package.xml, which is part of this package

from setuptools import find_packages, setup

package = ElementTree.parse('package.xml')  # nosec B314 # as above
name = package.findtext('name')
maintainer = package.find('maintainer')

setup(
    name=name,
    version=package.findtext('version'),
    description=package.findtext('description'),
    license=package.findtext('license'),
    url=package.findtext('url'),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    packages=find_packages(include=[name, name + '.*']),
    package_data={name: ['py.typed', 'studies/*.html', 'studies/*.js', 'control/models/*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + name]),
        ('share/' + name, ['package.xml']),
        ('share/' + name + '/config', sorted(glob('config/*.*'))),
        ('share/' + name + '/config/missions', sorted(glob('config/missions/*.yaml'))),
        ('share/' + name + '/config/ros2_control', sorted(glob('config/ros2_control/*'))),
        ('share/' + name + '/config/studies', sorted(glob('config/studies/*.yaml'))),
        ('share/' + name + '/config/sros2', sorted(glob('config/sros2/*.xml'))),
        ('share/' + name + '/launch', sorted(glob('launch/*.launch.py'))),
        ('share/' + name + '/rviz', sorted(glob('rviz/*.rviz'))),
        ('share/' + name + '/urdf', sorted(glob('urdf/*.xacro'))),
    ],
    python_requires='>=3.10',
    install_requires=['numba', 'numpy', 'PyYAML', 'scipy'],
    extras_require={
        'cluster': ['distributed'],
        'control': ['casadi', 'textual'],
        'figures': ['matplotlib', 'pillow', 'tqdm'],
        'learn': ['cma', 'gymnasium'],
        'studies': ['matplotlib', 'mcap', 'plotly', 'pyarrow', 'rosbags', 'tqdm'],
        'test': [
            'casadi', 'cma', 'gymnasium', 'hypothesis', 'matplotlib', 'mcap', 'pillow', 'plotly', 'pyarrow', 'pytest',
            'pytest-xdist', 'rosbags', 'textual', 'tqdm'],
    },
    zip_safe=False,  # Numba keeps compiled kernels beside the modules.
    entry_points={
        'console_scripts': [
            'averaged_model = manta_sim_ros.executables:averaged_model',
            'gait_node = manta_sim_ros.executables:gait_node',
            'linearize = manta_sim_ros.executables:linearize',
            'identify = manta_sim_ros.executables:identify',
            'monitor_node = manta_sim_ros.executables:monitor_node',
            'mpc_follower = manta_sim_ros.executables:mpc_follower',
            'paper_figures = manta_sim_ros.executables:paper_figures',
            'path_follower = manta_sim_ros.executables:path_follower',
            'path_gains = manta_sim_ros.executables:path_gains',
            'report = manta_sim_ros.executables:report',
            'simulate = manta_sim_ros.executables:simulate',
            'sim_node = manta_sim_ros.executables:sim_node',
            'sweep = manta_sim_ros.executables:sweep',
            'teleop = manta_sim_ros.executables:teleop',
            'track_node = manta_sim_ros.executables:track_node',
            'train_policy = manta_sim_ros.executables:train_policy',
        ],
    },
)
