# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = 'damadics_plant'

setup(
    name=package,
    version=ElementTree.parse('package.xml').findtext('version'),
    packages=find_packages(exclude=['test']),
    package_data={package: ['py.typed', 'scenarios/*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package]),
        ('share/' + package, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    maintainer='DAMADICS FD maintainers',
    maintainer_email='maintainers@damadics-fd.example',
    description='The DAMADICS benchmark actuator with 19 faults: simulator node and command.',
    license='Apache-2.0',
    extras_require={'test': ['pytest', 'hypothesis', 'scipy']},
    entry_points={
        'console_scripts': [
            'plant = damadics_plant.start:plant',
            'simulate = damadics_plant.command:main',
            'figures = damadics_plant.figures:main',
        ],
    },
)
