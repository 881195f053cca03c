from glob import glob

from setuptools import find_packages, setup

package_name = 'manta_sim_ros'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(include=[package_name, package_name + '.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', sorted(glob('config/*'))),
        ('share/' + package_name + '/launch', sorted(glob('launch/*.launch.py'))),
        ('share/' + package_name + '/rviz', sorted(glob('rviz/*.rviz'))),
        ('share/' + package_name + '/urdf', sorted(glob('urdf/*.xacro'))),
    ],
    install_requires=['matplotlib', 'numba', 'numpy', 'pillow', 'PyYAML', 'scipy', 'setuptools', 'tqdm'],
    extras_require={'test': ['hypothesis', 'pytest']},
    zip_safe=False,  # Numba keeps compiled kernels beside the modules.
    python_requires='>=3.10',
    maintainer='manta_sim_ros maintainers',
    maintainer_email='maintainers@example.org',
    description='Simulator of a robotic manta ray with flexible pectoral fins: a Python library and a ROS 2 node.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'gait_node = manta_sim_ros.executables:gait_node',
            'monitor_node = manta_sim_ros.executables:monitor_node',
            'paper_figures = manta_sim_ros.executables:paper_figures',
            'sim_node = manta_sim_ros.executables:sim_node',
        ],
    },
)
