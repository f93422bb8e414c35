"""Control logs as people and tools write them: taken where there is one meaning, else refused by line and value."""

import re
from pathlib import Path

import numpy as np
import pytest

from hovercraft_fmu.simulation import read_inputs
from hovercraft_fmu.simulation.control_log import ENDED, RECORDED, read_control_log

ROWS = [(0.0, 5.0, 0.0), (10.0, 5.0, 0.0), (10.0, 5.5, 1.0)]
"""time, thrust, port_thruster"""
PLAIN = "time,thrust,port_thruster\n0,5,0\n10,5,0\n10,5.5,1\n"

TAKEN = {
    "plain": PLAIN,
    "byte order mark": "\ufeff" + PLAIN,
    "lines of Windows": PLAIN.replace("\n", "\r\n"),
    "lines of an old Mac": PLAIN.replace("\n", "\r"),
    "no line end at the end": PLAIN.rstrip(),
    "blank lines": PLAIN.replace("\n", "\n\n  \n"),
    "comments": "# by hand\n" + PLAIN.replace("10,5,0", "  # then\n10,5,0"),
    "spaces": PLAIN.replace(",", " , "),
    "quotes": 'time,"thrust","port_thruster"\n"0","5","0"\n"10", "5" ,"0"\n10,5.5,1\n',
    "comma at the end of lines": PLAIN.replace("\n", ",\n"),
    "comma at the end of rows": PLAIN.replace("\n", ",\n").replace("port_thruster,", "port_thruster"),
    "empty rows of a spreadsheet": PLAIN + ",,\n,,\n",
    "tabs": PLAIN.replace(",", "\t"),
    "semicolons": PLAIN.replace(",", ";"),
    "semicolons, decimal comma": PLAIN.replace(",", ";").replace("5.5", "5,5"),
    "tabs, decimal comma": PLAIN.replace(",", "\t").replace("5.5", "5,50"),
    "capitals": PLAIN.replace("time", "Time").replace("thrust,", "THRUST,"),
    "units": PLAIN.replace("time", "time [s]")
    .replace("thrust,", "thrust [N],")
    .replace("port_thruster", "port_thruster (1)"),
    "exponents and signs": PLAIN.replace("10,5,0", "+1e1,.5E+1,-0").replace("5.5", "5.50"),
    "columns in another order": "port_thruster,time,thrust\n0,0,5\n0,10,5\n1,10,5.5\n",
    "columns of outputs, too": "time,thrust,pose.x,port_thruster\n0,5,0,0\n10,5,3,0\n10,5.5,3,1\n",
}
UTF_16 = PLAIN.replace(",", "\t").encode("utf-16")
"""What a spreadsheet calls Unicode text."""

REFUSED = {
    "empty": ("", "must have a header and at least one row"),
    "header alone": ("time,thrust\n", "must have a header and at least one row"),
    "no time": ("thrust\n5\n", "line 1: there must be a column 'time'"),
    "no header": ("0,5\n1,5\n", "line 1: column '0': must be 'time' or an input: thrust, "),
    "unknown name": ("time,trust\n0,5\n", "line 1: column 'trust': must be 'time' or an input: thrust, "),
    "a parameter": ("time,mass\n0,1\n", "line 1: column 'mass': must be 'time' or an input: thrust, "),
    "another unit": ("time [ms],thrust\n0,5\n", "line 1: column 'time [ms]': must be in 's'"),
    "twice": ("time,thrust,Thrust\n0,5,5\n", "line 1: column 'Thrust': must stand there once"),
    "no name": ("time,,thrust\n0,1,5\n", "line 1: column '': must be 'time' or an input"),
    "no number": ("time,thrust\n0,5\n\n1,full\n", "line 4: thrust = 'full': must be a finite number"),
    "missing value": ("time,thrust,port_thruster\n0,,0\n", "line 2: thrust = '': must be a finite number"),
    "NaN": ("time,thrust\n0,nan\n", "line 2: thrust = 'nan': must be a finite number"),
    "infinite": ("time,thrust\n0,1e999\n", "line 2: thrust = '1e999': must be a finite number"),
    "underscore": ("time,thrust\n0,1_0\n", "line 2: thrust = '1_0': must be a finite number"),
    "a value too few": ("time,thrust\n0\n", "line 2: must have 2 values, as the header has names; it has 1"),
    "a value too many": ("time,thrust\n0,5,1\n", "line 2: must have 2 values, as the header has names; it has 3"),
    "decimal comma between commas": ("time,thrust\n0,5,5\n", "line 2: must have 2 values"),
    "thousands": ("time;thrust\n0;1.234,5\n", "line 2: thrust = '1.234,5': must be a finite number"),
    "quoted comma between commas": ('time,thrust\n0,"1,234"\n', "line 2: thrust = '1,234': must be a finite number"),
    "back in time": ("time,thrust\n1,5\n0.5,5\n", "line 3: time = 0.5: must not go back; before it is 1.0"),
    "open quote": ('time,thrust\n0,"5\n', "line 2: a quote that is opened must be closed on its line"),
}


@pytest.mark.parametrize("text", TAKEN.values(), ids=TAKEN)
def test_what_has_one_meaning_is_taken(text: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode())
    table = read_inputs(path)
    assert [(row["time"], row["thrust"], row["port_thruster"]) for row in table] == ROWS
    assert table.dtype.names is not None
    assert table.dtype.names[0] == "time"
    assert set(table.dtype.names) == {"time", "thrust", "port_thruster"}


def test_the_unicode_text_of_a_spreadsheet_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_bytes(UTF_16)
    assert [tuple(row) for row in read_inputs(path)] == ROWS


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_what_has_not_is_refused_with_file_line_value_and_rule(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode())
    with pytest.raises(ValueError, match=re.escape(message)) as refused:
        read_inputs(path)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", [b"\xff\xfe\xff", b"time,thrust\n0,\xe9\n", b"PK\x03\x04\0\0\0", bytes(range(256))])
def test_what_is_no_text_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"log\.csv.*must be"):
        read_inputs(path)


def test_all_digits_are_kept(tmp_path: Path) -> None:
    values = np.random.default_rng(7).normal(size=500) * 10.0 ** np.arange(-250, 250)
    path = tmp_path / "log.csv"
    path.write_text("time,thrust\n" + "".join(f"{i},{value!r}\n" for i, value in enumerate(values.tolist())))
    assert (read_inputs(path)["thrust"] == values).all()


def test_a_record_that_was_cut_is_told_from_one_that_is_whole(tmp_path: Path) -> None:
    """Its last line may be half of one."""
    path, rows = tmp_path / "log.csv", f"time,thrust\n{RECORDED}\n0.0,5.0\n0.5,5.0\n1.0,7"
    for end, cut, last in (("", True, 0.5), (".5\n", True, 1.0), (f".5\n{ENDED}by the operator\n", False, 1.0)):
        path.write_text(rows + end)
        table, is_cut, *_ = read_control_log(path)
        assert (is_cut, table["time"][-1]) == (cut, last)
