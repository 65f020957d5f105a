# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = 'damadics_evaluate'

setup(
    name=package,
    version=ElementTree.parse('package.xml').findtext('version'),
    packages=find_packages(exclude=['test']),
    package_data={package: ['report/*.j2']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package]),
        ('share/' + package, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=False,
    maintainer='DAMADICS FD maintainers',
    maintainer_email='maintainers@damadics-fd.example',
    description='Indices of the DAMADICS benchmark, baselines, campaigns and reports.',
    license='Apache-2.0',
    extras_require={
        'test': ['pytest', 'hypothesis'],
        'report': ['jinja2', 'markupsafe', 'matplotlib', 'pillow'],
        'parquet': ['pyarrow'],
        'baselines': ['river', 'filterpy', 'scikit-learn', 'scipy'],
        'cluster': ['dask[distributed]'],
    },
    entry_points={'console_scripts': ['evaluate = damadics_evaluate:main']},
)
