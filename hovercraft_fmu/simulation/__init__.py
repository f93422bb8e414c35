"""Plans a scene, or inputs of your own, and runs it: on an FMU, or on the bare model; one kind of result."""

from ..fmu.start_values import Value, start_value
from .advice import WITHIN, Advice, Tried, advise
from .bare_run import run_model
from .comparison import Difference, differences, read_columns
from .control_log import read_inputs
from .cost import ROOT, SINE, counted
from .fmu_run import Stepper, run_fmu, simulate, stepping
from .planning import Inputs, Progress, Run, check_effect, check_steps, method_in_words, plan
from .points import Piece, ends, held_steps, holding, is_ramped, schedule
from .result import Result, check_output, metres, path_length, write_csv

__all__ = [
    "ROOT",
    "SINE",
    "WITHIN",
    "Advice",
    "Difference",
    "Inputs",
    "Piece",
    "Progress",
    "Result",
    "Run",
    "Stepper",
    "Tried",
    "Value",
    "advise",
    "check_effect",
    "check_output",
    "check_steps",
    "counted",
    "differences",
    "ends",
    "held_steps",
    "holding",
    "is_ramped",
    "method_in_words",
    "metres",
    "path_length",
    "plan",
    "read_columns",
    "read_inputs",
    "run_fmu",
    "run_model",
    "schedule",
    "simulate",
    "start_value",
    "stepping",
    "write_csv",
]
