# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = 'damadics_dashboard'

setup(
    name=package,
    version=ElementTree.parse('package.xml').findtext('version'),
    packages=find_packages(exclude=['test']),
    package_data={
        package: ['static/*'],
        f'{package}.words': ['*.yaml'],
        f'{package}.pages': ['templates/*.html'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package]),
        ('share/' + package, ['package.xml']),
    ],
    install_requires=['setuptools', 'nicegui'],
    zip_safe=False,
    maintainer='DAMADICS FD maintainers',
    maintainer_email='maintainers@damadics-fd.example',
    description='A web page for the people at the plant.',
    license='Apache-2.0',
    extras_require={'test': ['pytest'], 'report': ['fpdf2==2.8.9']},
    entry_points={
        'console_scripts': [
            'dashboard = damadics_dashboard.start:dashboard',
            'report = damadics_dashboard.report.command:main',
        ]
    },
)
