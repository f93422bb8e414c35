"""The FMU through fmpy's low-level interface, that of FMI 2.0 for every FMU."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException

from hovercraft_fmu.fmu.interface import ACTION, BY_NAME, INPUTS, MOTION, STATES, VARIABLES
from hovercraft_fmu.host import Fmu, Instance
from tests.blobs import BUILD, with_word

REALS = [v for v in VARIABLES if v.kind == "Real"]
INTEGERS = [v for v in VARIABLES if v.kind != "Real"]
CONTINUOUS = (*INPUTS, *STATES, *MOTION, *ACTION)


def reference(name: str) -> int:
    return BY_NAME[name].reference


def start(instance: Any, time: float = 0.0, **values: float) -> None:
    instance.setupExperiment(startTime=time)
    put(instance, **values)
    instance.enterInitializationMode()
    instance.exitInitializationMode()


def put(instance: Any, **values: float) -> None:
    """Set reals by name; a dot in a name is written as two underscores."""
    if values:
        instance.setReal([reference(name.replace("__", ".")) for name in values], list(values.values()))


def get(instance: Any, *names: str) -> list[float]:
    return list(instance.getReal([reference(name) for name in names]))


def count(instance: Any, name: str = "substeps") -> int:
    return int(instance.getInteger([reference(name)])[0])


def everything(instance: Any) -> dict[str, Any]:
    """All that can be read, by name. Where nothing can, in FMI 2.0 before initialization, the whole state, as bytes."""
    try:
        values = list(instance.getReal([v.reference for v in REALS]))
    except FMICallException:
        assert "in state 'instantiated': must be called in state" in instance.host.messages.pop()
        return {"": bytes(instance.serializeFMUstate(instance.getFMUstate()))}
    values += instance.getInteger([v.reference for v in INTEGERS])
    return {variable.name: value for variable, value in zip((*REALS, *INTEGERS), values, strict=True)}


WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4
DISCARDED_BY_FMI_2 = {
    "fmi2SetReal": "both", "fmi2SetInteger": "both", "fmi2DoStep": "both", "fmi2SetContinuousStates": "exchange",
    "fmi2GetReal": "exchange", "fmi2GetDerivatives": "exchange", "fmi2GetContinuousStates": "exchange",
}  # fmt: skip
"""Which functions can be, and of an instance for what (2.1.3)."""
OF_THE_CALL = ("communicationStepSize = ", "currentCommunicationPoint = ", "startTime = ", "time = ", "fmi")
"""How messages begin that are of arguments, times and phases, not of values that could be others."""
OF_VALUES = (
    "must be a finite number", "must be greater than 0", "must not be negative", "must be from ", "must be one of ",
    "must be 0 ", "must be the same where both are set", "must not be above", "must not need more than",
    "must not fall below", "must stay a finite number", "must lead to finite inputs", "must slide", "must be off",
    "must not drive",
)  # fmt: skip


def status_of_refusal(instance: Any, refused: FMICallException, message: str, exchange: bool = False) -> int:
    """What the standards have for it: a call can be discarded where other values, another step or state would do."""
    if instance.host.description.coSimulation.modelIdentifier == "Hovercraft":
        return FATAL  # all that pythonfmu's wrapper has
    avoidable = any(rule in message for rule in OF_VALUES) and not message.startswith(OF_THE_CALL)
    if not isinstance(instance, Instance3):
        use = DISCARDED_BY_FMI_2.get(refused.function, "")
        avoidable = avoidable and (use == "both" or (use == "exchange" and exchange))
    return DISCARD if avoidable else ERROR


FMI_3_NAMES = {
    "setReal": "setFloat64",
    "getReal": "getFloat64",
    "getRealOutputDerivatives": "getOutputDerivatives",
    "fmi2GetRealOutputDerivatives": "fmi3GetOutputDerivatives",
    "newDiscreteStates": "updateDiscreteStates",
    "getDerivatives": "getContinuousStateDerivatives",
    "getFMUstate": "getFMUState",
    "setFMUstate": "setFMUState",
    "freeFMUstate": "freeFMUState",
    "serializeFMUstate": "serializeFMUState",
    "deSerializeFMUstate": "deserializeFMUState",
    "fmi2GetFMUstate": "fmi3GetFMUState",
    "fmi2FreeFMUstate": "fmi3FreeFMUState",
    "fmi2SerializeFMUstate": "fmi3SerializeFMUState",
}
FMI_3_WORDS = {
    "fmi2SetupExperiment": "fmi3EnterInitializationMode",
    "fmi2NewDiscreteStates": "fmi3UpdateDiscreteStates",
    "fmi2GetDerivatives": "fmi3GetContinuousStateDerivatives",
    "FMUstate: ": "FMUState: ",
    "fmi2": "fmi3",
    "type Real": "type Float64",
    "type Integer or Enumeration": "type Int32",
}


class Instance3:
    """fmpy's instance of FMI 3.0 with the methods of its instance of FMI 2.0.

    To set up an experiment is a part of entering the initialization there, so it is done then.
    """

    def __init__(self, made: Any) -> None:
        self.made = made
        self.is_set_up = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self.made, named(self, name))

    def setupExperiment(self, **given: float | None) -> None:  # noqa: N802 - fmpy's name
        self.made.enterInitializationMode(**given)
        self.is_set_up = True

    def enterInitializationMode(self) -> None:  # noqa: N802
        if not self.is_set_up:
            self.made.enterInitializationMode()
        self.is_set_up = False

    def reset(self) -> None:
        self.made.reset()
        self.is_set_up = False

    def getInteger(self, references: Sequence[int]) -> list[int]:  # noqa: N802
        return [self._of_its_type("get", each)([each])[0] for each in references]

    def setInteger(self, references: Sequence[int], values: Sequence[int]) -> None:  # noqa: N802
        for each, value in zip(references, values, strict=True):
            self._of_its_type("set", each)([each], [value])

    def _of_its_type(self, verb: str, reference: int) -> Any:
        enumerations = {variable.reference for variable in VARIABLES if variable.enumeration}
        return getattr(self.made, verb + ("Int64" if reference in enumerations else "Int32"))


def named(instance: Any, function: str) -> str:
    """A function of FMI 2.0 as the standard of an instance has it."""
    return FMI_3_NAMES.get(function, function.replace("fmi2", "fmi3")) if isinstance(instance, Instance3) else function


def worded(instance: Any, message: str) -> str:
    """A message of an FMI 2.0 FMU as the standard of an instance has it."""
    for old, new in FMI_3_WORDS.items() if isinstance(instance, Instance3) else ():
        message = message.replace(old, new)
    return message


@contextmanager
def one(fmu: Path, exchange: bool = False) -> Iterator[tuple[Any, list[str]]]:
    """An instance, for co-simulation or model exchange, and the messages that come from it."""
    with Fmu(fmu) as opened, opened.instance(exchange) as instance:
        yield _low_level(instance, opened), instance.messages


def _low_level(instance: Instance, opened: Fmu) -> Any:
    made = instance.fmpy
    made.host, made.opened = instance, opened  # which live as long
    made._functions = {name: _loud(each, instance.messages) for name, each in made._functions.items()}
    return Instance3(made) if opened.is_fmi_3 else made


def _loud(function: Any, messages: list[str]) -> Any:
    """A function of the standard, of which a warning comes with a message: else all is well."""

    def call(*arguments: Any) -> Any:
        before = len(messages)
        status = function(*arguments)
        assert status != WARNING or len(messages) > before, f"{function.__name__}: a warning without a word"
        return status

    vars(call).update({name: getattr(function, name) for name in ("restype", "argtypes", "argnames")})
    return call


def another(instance: Any) -> Any:
    """A further instance of the same extracted FMU."""
    return _low_level(instance.opened.instance(), instance.opened)


def kept(instance: Any, through_bytes: bool) -> Any:
    """The state of an instance, as it is or made again from what it was serialized to."""
    state = instance.getFMUstate()
    if not through_bytes:
        return state
    content = instance.serializeFMUstate(state)
    instance.freeFMUstate(state)
    return instance.deSerializeFMUstate(content)


def with_any_other_word(instance: Any) -> None:
    """Of its state, signed anew: what is taken is written as it was taken, and some is refused."""
    content, outcomes = bytes(instance.serializeFMUstate(instance.getFMUstate())), set()
    for offset in range(BUILD.stop, len(content) - 8, 4):
        for word in (0x7FF00000, 0xFFFFFFFF):
            try:
                state = instance.deSerializeFMUstate(with_word(content, offset, word))
            except FMICallException:
                outcomes.add("refused")
                continue
            outcomes.add("taken")
            once = bytes(instance.serializeFMUstate(state))
            assert bytes(instance.serializeFMUstate(instance.deSerializeFMUstate(once))) == once
            instance.freeFMUstate(state)
    assert outcomes == {"refused", "taken"}
