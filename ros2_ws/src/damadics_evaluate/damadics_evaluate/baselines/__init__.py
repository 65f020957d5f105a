# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detectors under test: the SCADA-rate monitor and what a user would pick instead."""

from damadics_evaluate.baselines.classifiers import Forest, Network
from damadics_evaluate.baselines.coherency import Coherency
from damadics_evaluate.baselines.drift import Adwin, PageHinkley
from damadics_evaluate.baselines.innovation import InnovationEkf
from damadics_evaluate.baselines.multivariate import IsolationForest, PrincipalComponents
from damadics_evaluate.baselines.narx import NarxHotelling
from damadics_evaluate.baselines.residuals import (
    CusumOnDeviation,
    Ewma,
    FirCusum,
    FixedThreshold,
    Glr,
    SmartPositioner,
)
from damadics_evaluate.baselines.scada import FlowThreshold, ModelThreshold, Scada
from damadics_evaluate.detectors.base import Detector, MissingPackageError

DETECTORS: dict[str, type[Detector]] = {
    kind.name: kind
    for kind in (
        Scada,
        FixedThreshold,
        Ewma,
        CusumOnDeviation,
        FirCusum,
        Glr,
        SmartPositioner,
        InnovationEkf,
        PageHinkley,
        Adwin,
        PrincipalComponents,
        IsolationForest,
        Coherency,
        NarxHotelling,
        Forest,
        Network,
        ModelThreshold,
        FlowThreshold,
    )
}

__all__ = ['DETECTORS', 'Detector', 'MissingPackageError']
