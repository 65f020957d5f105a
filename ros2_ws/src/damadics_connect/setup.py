# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = 'damadics_connect'

setup(
    name=package,
    version=ElementTree.parse('package.xml').findtext('version'),
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package]),
        ('share/' + package, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    maintainer='DAMADICS FD maintainers',
    maintainer_email='maintainers@damadics-fd.example',
    description='OPC UA, MQTT, HTTP and notifications: signals in, judgements out.',
    license='Apache-2.0',
    extras_require={
        'opcua': ['asyncua'],
        'mqtt': ['aiomqtt', 'protobuf'],
        'http': ['fastapi', 'pydantic', 'uvicorn', 'prometheus-client'],
        'notify': ['apprise'],
        'parquet': ['pyarrow'],
        'test': ['pytest', 'amqtt', 'aiosmtpd', 'httpx'],
    },
    entry_points={
        'console_scripts': [
            'opcua = damadics_connect.start:opcua',
            'mqtt = damadics_connect.start:mqtt',
            'http = damadics_connect.start:http',
            'notify = damadics_connect.start:notify',
            'files = damadics_connect.start:files',
        ],
    },
)
