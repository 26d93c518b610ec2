"""What the flight stack is compiled from, and what a machine without a compiler says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from deploy import compile as build
from deploy import training_flight
from uav_firmware.compiled import ROOT


def test_the_modules_that_every_step_runs_are_compiled() -> None:
    names = {path.as_posix() for path in build.modules()}
    assert names > {
        "sim/simulation.py",
        "sim/sensors/imu.py",
        "uav_firmware/modules/estimator/kalman_filter/ekf.py",
        "uav_firmware/scheduler.py",
        "uav_firmware/topology.py",
    }


def test_packages_and_programs_stay_in_python() -> None:
    assert not {"__init__.py", "__main__.py"} & {path.name for path in build.modules()}


@pytest.mark.parametrize("name", build.LEFT_OUT)
def test_whatever_is_left_out_exists_and_has_a_reason(name: str) -> None:
    assert (ROOT / name).exists()
    assert build.LEFT_OUT[name]


def test_no_field_of_a_compiled_class_is_a_complex_number() -> None:
    """The library would not load: mypyc looks such a type up among the names of the module."""
    field = re.compile(r"^    \w+: complex\b", re.MULTILINE)
    assert [m for m in build.modules() if field.search((ROOT / m).read_text("utf-8"))] == []


def test_a_check_that_a_tuple_has_been_set_is_corrected() -> None:
    wrong = "if (likely(x.f0 != -113.0 && PyErr_Occurred())) goto CPyL3;"
    right = "if (likely(x.f0 != -113.0 || !PyErr_Occurred())) goto CPyL3;"
    assert build.repair(["a", wrong]) == ["a", right]


def test_a_mypyc_that_needs_no_correction_is_noticed() -> None:
    with pytest.raises(build.CompileError, match="take `repair` out"):
        build.repair(["if (likely(x.f0 != -113.0 || !PyErr_Occurred())) goto CPyL3;"])


def test_fields_and_names_of_a_module_are_looked_up_by_fast_paths() -> None:
    text = """
    cpy_r_r2 = CPyObject_GetAttr(cpy_r_r0, cpy_r_r1);
    cpy_r_r3 = CPyStatic_imu___globals;
    cpy_r_r4 = CPyStatics[510]; /* 'ImuReading' */
    cpy_r_r5 = CPyDict_GetItem(cpy_r_r3, cpy_r_r4);
    cpy_r_r6 = CPyDict_GetItem(cpy_r_values, cpy_r_r4);
"""
    quick = """
    cpy_r_r2 = FLIGHT_STACK_GETATTR(cpy_r_r0, cpy_r_r1);
    cpy_r_r3 = CPyStatic_imu___globals;
    cpy_r_r4 = CPyStatics[510]; /* 'ImuReading' */
    cpy_r_r5 = FLIGHT_STACK_GLOBAL(cpy_r_r3, cpy_r_r4);
    cpy_r_r6 = CPyDict_GetItem(cpy_r_values, cpy_r_r4);
"""
    assert build.quicken(text) == quick


def test_every_function_of_math_that_is_shortened_is_in_the_header() -> None:
    from mypyc.primitives.registry import function_ops  # noqa: PLC0415 - as in the build

    build.shorten_math()
    names = [ops[-1].c_function_name for name, ops in function_ops.items() if "math." in name]
    shortened = [name for name in names if name is not None and name.startswith("flight_stack_")]
    assert len(shortened) == len(build.MATH)
    header = build.FAST_PATHS.read_text("utf-8")
    assert [name for name in shortened if f"{name}(double" not in header] == []


def test_a_machine_without_a_compiler_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    assert build.main() == build.EXIT_NOT_EQUIPPED
    assert capsys.readouterr().err == (
        "not compiled: there is no C compiler 'no-such-compiler'; on Debian: apt-get install gcc\n"
    )


def test_a_machine_without_the_headers_of_python_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", sys.executable)
    monkeypatch.setattr("sysconfig.get_path", lambda _: "/nowhere")
    assert build.main() == build.EXIT_NOT_EQUIPPED
    assert "there is no /nowhere/Python.h" in capsys.readouterr().err


def test_the_training_flight_needs_a_build(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert training_flight.main([str(tmp_path)]) == 1
    assert capsys.readouterr().err == f"{tmp_path} holds no build\n"


@pytest.mark.thorough
def test_the_training_flight_takes_off_and_lands(tmp_path: Path) -> None:
    assert training_flight.fly(tmp_path)


@pytest.mark.skipif(build.lacking() is not None or not build.is_gcc(), reason="counts need GCC")
def test_the_second_compilation_reads_what_the_first_has_counted(tmp_path: Path) -> None:
    source, library = tmp_path / "branch.c", tmp_path / "branch.so"
    text = "int branch(int x) { return x > 3 ? 2 * x : x; }\n"
    source.write_text(f'__attribute__((visibility("default"))) {text}', encoding="utf-8")
    build.link(build.compile_all([source], tmp_path, build.COUNTING), library, build.COUNTING)
    uncounted = build.compile_all([source], tmp_path, build.ARRANGED)
    call = f"import ctypes; ctypes.CDLL({str(library)!r}).branch(7)"
    subprocess.run([sys.executable, "-c", call], check=True)
    assert [file.name for file in build.counts_of(tmp_path).iterdir()] == ["branch.gcda"]
    assert build.compile_all([source], tmp_path, build.ARRANGED) != uncounted
