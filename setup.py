"""The package, as ament_python and pip want it described."""

from pathlib import Path
import sys

from setuptools import find_packages, setup

PACKAGE = 'lip_id_ros'
AUTHORS, MAIL = 'the lip_id_ros authors', 'maintainers@lip-id-ros.example'
HOME_PAGE = 'https://lip-id-ros.example'  # a placeholder until the project has an address
README = Path(__file__).resolve().parent / 'README.md'  # colcon builds beside a link
WHEEL = {'bdist_wheel', 'dist_info', 'editable_wheel'}  # the commands that pip runs
NODES = [
    f'{name} = lip_id_ros.__main__:{name}'
    for name in ('train', 'excite', 'serve', 'monitor', 'adapt', 'simulated_panda')
]


def files(folder: str, pattern: str = '*') -> list[str]:
    return sorted(str(path) for path in Path(folder).glob(pattern) if path.is_file())


def programs() -> list[str]:
    """Return lip_id, and the nodes for `ros2 run`: a wheel has none, as Ray's is called serve."""
    program = ['lip_id = lip_id_ros.__main__:lip_id']
    if WHEEL & set(sys.argv):
        return program
    return program + NODES


setup(
    name=PACKAGE,
    version='0.1.0',
    description='Inverse dynamics of robot arms, learned from recordings and served as torques',
    long_description=README.read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author=AUTHORS,
    author_email=MAIL,
    maintainer=AUTHORS,
    maintainer_email=MAIL,
    url=HOME_PAGE,
    project_urls={'Documentation': f'{HOME_PAGE}/docs', 'Issues': f'{HOME_PAGE}/issues'},
    keywords=['ROS', 'robotics', 'inverse dynamics', 'system identification', 'feedforward'],
    classifiers=[
        'Development Status :: 4 - Beta',
        'Environment :: Console',
        'Intended Audience :: Science/Research',
        'Intended Audience :: Manufacturing',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Programming Language :: Python :: 3.13',
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    license='Apache-2.0',
    license_files=['LICENSE'],
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    python_requires='>=3.11',
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', files('config')),
        (f'share/{PACKAGE}/launch', files('launch')),
    ],
    install_requires=[
        'argcomplete>=3.0',
        'backports.zstd>=1.0; python_version < "3.14"',
        'fsspec>=2024.2',
        'lz4>=4.1',
        'matplotlib>=3.6',
        'numba>=0.59',
        'numpy>=1.26',
        'pyyaml>=6.0',
        'rich>=13.0',
        'rosbags>=0.11.7',
        'scipy>=1.11',
        'threadpoolctl>=3.1',
    ],
    extras_require={
        'export': ['mujoco>=3.2'],
        'ray': ['ray[client]>=2.30'],
        'sim': ['pin>=3.0', 'example-robot-data>=4.1'],
        'test': [
            'flask>=3.0',
            'flask-cors>=4.0',
            'hypothesis>=6.98',
            'mcap>=1.1',
            'mcap-ros2-support>=0.5',
            'moto[s3]>=5.0',
            'psutil>=5.9',
            'pytest>=7.4,<9',
            's3fs>=2024.2',
            'torch>=2.1',
        ],
    },
    package_data={
        PACKAGE: ['py.typed'],
        f'{PACKAGE}.export': ['*.in'],
        f'{PACKAGE}.fleet': ['*.html'],
    },
    zip_safe=False,
    entry_points={'console_scripts': programs()},
)
