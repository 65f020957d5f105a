# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from setuptools import find_packages, setup

package = 'damadics_fd'

setup(
    name=package,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package: ['py.typed', '*.yaml', 'evaluate/*.j2']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package]),
        ('share/' + package, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    maintainer='DAMADICS FD maintainers',
    maintainer_email='maintainers@damadics-fd.example',
    description='Fault detection for control valves: on-line approximator, recording, replay.',
    license='Apache-2.0',
    extras_require={
        'test': ['pytest', 'hypothesis'],
        'progpy': ['progpy'],  # test only: an independent plant
        'evaluate': ['jinja2', 'matplotlib', 'river', 'filterpy', 'scikit-learn'],
        'cluster': ['dask[distributed]'],
        'parquet': ['pyarrow'],
    },
    entry_points={
        'console_scripts': [
            'estimator = damadics_fd.estimator:main',
            'detector = damadics_fd.detector:main',
            'monitors = damadics_fd.monitors:main',
            'recorder = damadics_fd.recorder:main',
            'evaluate = damadics_fd.evaluate:main',
            'replay = damadics_fd.replay:main',
            'verify = damadics_fd.verify:main',
            'recover = damadics_fd.recover:main',
            'commission = damadics_fd.commission:main',
        ],
    },
)
