# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from glob import glob
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = 'damadics_bringup'

setup(
    name=package,
    version=ElementTree.parse('package.xml').findtext('version'),
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package]),
        ('share/' + package, ['package.xml']),
        ('share/' + package + '/launch', glob('launch/*.py')),
        ('share/' + package + '/config', glob('config/*')),
        ('share/' + package + '/layouts', glob('layouts/*')),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    maintainer='DAMADICS FD maintainers',
    maintainer_email='maintainers@damadics-fd.example',
    description='Launch files, parameter files, layouts and the demonstration of DAMADICS FD.',
    license='Apache-2.0',
    extras_require={'test': ['pytest'], 'demo_plant': ['aiomqtt', 'amqtt', 'asyncua']},
    entry_points={
        'console_scripts': [
            'demo = damadics_bringup.start:demo',
            'demo_plant = damadics_bringup.demo_plant.command:main',
            'init = damadics_bringup.init:main',
            'opcua_plant = damadics_bringup.demo_plant.opcua_plant:main',
            'policy = damadics_bringup.policy:main',
            'run = damadics_bringup.launcher:main',
        ]
    },
)
