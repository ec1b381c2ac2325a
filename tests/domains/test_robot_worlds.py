"""The robot worlds: their README files are true, their languages hold, Fast Downward agrees, their pictures exist."""

from __future__ import annotations

import re
import shlex
import sys
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner

from coordlang.build import build_language
from coordlang.cli.app import cli
from coordlang.tasks import Candidates, all_pairs, from_listed, from_problems, read_task_file
from coordlang.witness import miscoordination
from planners.fast_downward import optimal_cost
from planners.joint import Cost
from planners.model import Loaded, ModelOptions, load
from planners.optimal import search
from planners.plans import Plans
from planners.pddl import read_domain, read_problem
from planners.space import explore
