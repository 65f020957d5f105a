# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = 'damadics_fd'

setup(
    name=package,
    version=ElementTree.parse('package.xml').findtext('version'),
    packages=find_packages(exclude=['test']),
    package_data={package: ['py.typed', '*.yaml', 'ros/process/*.xml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package]),
        ('share/' + package, ['package.xml']),
    ],
    install_requires=['setuptools', 'llvmlite'],  # comes with numba
    zip_safe=False,
    maintainer='DAMADICS FD maintainers',
    maintainer_email='maintainers@damadics-fd.example',
    description='Fault detection for control valves: on-line approximator, recording, replay.',
    license='Apache-2.0',
    extras_require={
        'test': ['pytest', 'hypothesis'],
        'progpy': ['progpy'],  # test only: an independent plant
        'parquet': ['pyarrow'],
        'cluster': ['dask[distributed]'],
        'web': ['uvicorn'],  # what a page or a connector serves with
        'compression': ['isal', 'lz4'],  # faster gzip and checksums; bags of others in LZ4
    },
    entry_points={
        'console_scripts': [
            'estimator = damadics_fd.start:estimator',
            'detector = damadics_fd.start:detector',
            'monitors = damadics_fd.start:monitors',
            'fleet = damadics_fd.start:fleet',
            'recorder = damadics_fd.start:recorder',
            'evaluate = damadics_fd.commands.evaluate:main',
            'replay = damadics_fd.start:replay',
            'verify = damadics_fd.commands.verify:main',
            'recover = damadics_fd.commands.recover:main',
            'commission = damadics_fd.start:commission',
            'settings = damadics_fd.commands.settings:main',
        ],
    },
)
