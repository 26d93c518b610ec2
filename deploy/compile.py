"""`python -m deploy.compile`: compile the flight stack with mypyc, for `uav_firmware.compiled`.

mypyc translates typed modules to C: the same statements on the same numbers, so that a flight
has the same bytes of telemetry, without the interpreter. All modules of the autopilot and of the
physics in which it flies are one library. GCC compiles it twice: the first one counts, in a flight
of `deploy.training_flight`, what a step runs; in the second that lies together in memory, and the
rest, most of it error paths, out of its way. The result is `uav_firmware/_compiled/`; C files,
counts and objects stay in `build/compiled/`, where the next run finds what has not changed.

Exit codes: 0 compiled; 1 a module cannot be compiled; 2 the machine lacks a compiler, Python's
headers or mypyc.
"""

import argparse
import contextlib
import hashlib
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

from uav_firmware.compiled import (
    FOLDER,
    LIBRARY,
    MANIFEST,
    ROOT,
    SUFFIX,
    Manifest,
    abi,
    hashes,
    sources,
)

BUILD: Final = ROOT / "build" / "compiled"
FAST_PATHS: Final = Path(__file__).with_name("fast_paths.h")
EXIT_FAILED: Final = 1
EXIT_NOT_EQUIPPED: Final = 2

LEFT_OUT: Final = {
    "uav_firmware/compiled.py": "it finds the others",
    "uav_firmware/parameters.py": "an int given for a float is a float in C: INT32 or REAL32",
    "uav_firmware/cal/": "protocols that are checked at run time have no instance check in C",
    "uav_firmware/drivers/background.py": "ParamSpec, and an exception with OSError's layout",
    "uav_firmware/modules/estimator/fault_detection/common_gyro_jump.py": "complex numbers",
    "uav_firmware/modules/mavlink/wire/dialect_extensions.py": "inherits from pymavlink's classes",
    "uav_firmware/modules/rotor_loss_control/controller.py": "complex numbers",
    "sim/fault_schedule.py": "its numbers keep the type that a file gives them",
    "sim/faults/console.py": "polls a file; beside the notation",
    "sim/faults/notation.py": "a starred value in a return ends mypyc 2.4.1; read once",
    "sim/physics/airframe.py": "an exception with the layout of OSError; runs once",
}
"""Modules that stay in Python, and why. A path that ends with / stands for a folder."""

# Compiled for any processor of the kind, never -march=native; and a product and a sum are rounded
# one after the other as the interpreter rounds them: GCC fuses the two on ARM without this option.
_FLAGS: Final = (
    "-O2", "-DNDEBUG", "-fwrapv", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", "-w",
    "-pthread", "-fno-plt",
)  # fmt: skip


class Pass(NamedTuple):
    """What distinguishes one compilation of the library by GCC."""

    objects: str  # Folder that keeps them
    flags: Sequence[str] = ()


COUNTING: Final = Pass("counting", ("-fprofile-generate", "-fprofile-update=single"))
ARRANGED: Final = Pass("objects", ("-fprofile-use", "-fprofile-partial-training"))
PLAIN: Final = Pass("objects")
"""For a compiler other than GCC."""
STUBS: Final = Pass("stubs")

MATH: Final = {"isfinite": 1, "radians": 1, "degrees": 1, "atan2": 2}
"""Functions of `math`, and how many floats each takes."""
_MYPY: Final = """[mypy]
[mypy-pymavlink.*,jsbsim.*]
ignore_missing_imports = True
follow_imports = skip
"""
_GLOBAL: Final = re.compile(
    r"(cpy_r_\w+) = CPyStatic_\w+___globals;\n\s+(cpy_r_\w+) = CPyStatics\[\d+\];.*\n"
    r"\s+cpy_r_\w+ = CPyDict_GetItem\(\1, \2\);"
)
_FAULTY_CHECK: Final = re.compile(r"(\.f\d+ != -113\.0) && PyErr_Occurred\(\)")


class CompileError(Exception):
    """What stands in the way, in a sentence."""


def modules(root: Path = ROOT) -> list[Path]:
    """Sources that are compiled, by path from the root."""
    names = (path.relative_to(root).as_posix() for path in sources(root))
    return [Path(name) for name in names if not _is_left_out(name)]


def _is_left_out(name: str) -> bool:
    if Path(name).name in {"__init__.py", "__main__.py"}:
        return True
    return any(name.startswith(left) if left[-1] == "/" else name == left for left in LEFT_OUT)


def lacking() -> str | None:
    """What this machine needs before anything can be compiled; None if it has it all."""
    command = compiler()[0]
    if shutil.which(command) is None:
        return f"there is no C compiler {command!r}; on Debian: apt-get install gcc"
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        return f"there is no {header}; on Debian: apt-get install python3-dev"
    try:
        import mypyc.build  # noqa: F401, PLC0415 - looked for
    except ImportError as error:
        return f"mypyc cannot be loaded ({error}); pip install mypy setuptools"
    return None


def compiler() -> list[str]:
    """The C compiler as a command: CC, or the one that Python was built with."""
    return shlex.split(os.environ.get("CC") or str(sysconfig.get_config_var("CC") or "cc"))


class CFiles(NamedTuple):
    """What the library is made of."""

    modules: Sequence[Path]  # Written by mypyc
    stubs: Sequence[Path]  # As above, one per module
    runtime: Sequence[Path]  # That comes with mypyc


def translate(paths: Sequence[Path], build: Path) -> CFiles:
    """Write the C of the library and of the stub of each module.

    Raises:
        CompileError: with mypyc's messages, if a module cannot be compiled.
    """
    from mypyc.build import (  # noqa: PLC0415 - see `lacking`
        generate_c_extension_shim,
        include_dir,
        mypyc_build,
    )
    from mypyc.common import RUNTIME_C_FILES  # noqa: PLC0415 - as above
    from mypyc.options import CompilerOptions  # noqa: PLC0415 - as above

    shorten_math()
    build.mkdir(parents=True, exist_ok=True)
    config = build / "mypy.ini"
    config.write_text(_MYPY, encoding="utf-8")
    name = LIBRARY.removesuffix("__mypyc")
    options = CompilerOptions(multi_file=True, target_dir=str(build), group_name=name)
    arguments = [f"--config-file={config}", *map(str, paths)]
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):  # Mostly advice on speed, by the hundred
            groups, files, needs = mypyc_build(arguments, options, always_use_shared_lib=True)
    except SystemExit as error:
        errors = [line for line in said.getvalue().splitlines() if " warning: " not in line]
        raise CompileError("\n".join(("mypyc refuses:", *errors))) from error
    stubs = [
        generate_c_extension_shim(source.module, source.module.split(".")[-1], str(build), name)
        for source in groups[0][0]
    ]
    runtime = sorted({*RUNTIME_C_FILES, *(need.path for need in needs)})
    return CFiles(
        [Path(file) for file in files[0][0]],
        [Path(stub) for stub in stubs],
        [Path(include_dir()) / name for name in runtime],
    )


def shorten_math() -> None:
    """Let mypyc call C for functions of `math` on floats that it leaves to the interpreter.

    It calls C for sin and sqrt. These are as simple: `fast_paths.h` gives what CPython gives.
    """
    from mypyc.ir.ops import ERR_NEVER  # noqa: PLC0415 - see `lacking`
    from mypyc.ir.rtypes import bool_rprimitive, float_rprimitive  # noqa: PLC0415 - as above
    from mypyc.primitives.registry import function_op, function_ops  # noqa: PLC0415 - as above

    for name, arity in MATH.items():
        if f"math.{name}" not in function_ops:
            function_op(
                name=f"math.{name}",
                arg_types=[float_rprimitive] * arity,
                return_type=bool_rprimitive if name.startswith("is") else float_rprimitive,
                c_function_name=f"flight_stack_{name}",
                error_kind=ERR_NEVER,
            )


def repair(texts: Iterable[str]) -> list[str]:
    """Correct mypyc's check that a final tuple of floats has been set.

    mypyc 2.4.1 writes `value != -113.0 && PyErr_Occurred()`, which holds for no tuple that has
    been set; every use raises a NameError. It means `||` and `!`.

    Raises:
        CompileError: if there is nothing to correct: this mypyc needs no repair any more.
    """
    repaired, number = [], 0
    for text in texts:
        better, count = _FAULTY_CHECK.subn(r"\1 || !PyErr_Occurred()", text)
        repaired.append(better)
        number += count
    if number == 0:
        raise CompileError("this mypyc checks final tuples otherwise: take `repair` out, or adapt")
    return repaired


def quicken(text: str) -> str:
    """Let lookups of fields and of a module's names take the paths of `fast_paths.h`."""
    text = text.replace("= CPyObject_GetAttr(", "= FLIGHT_STACK_GETATTR(")
    return _GLOBAL.sub(
        lambda found: found[0].replace("CPyDict_GetItem", "FLIGHT_STACK_GLOBAL"), text
    )


def build_library(files: CFiles, build: Path, into: Path, how: Pass) -> None:
    """Compile and link the library.

    Raises:
        CompileError: with the compiler's message.
    """
    parts = compile_all([*files.runtime, *files.modules], build, how)
    link(parts, into / f"{LIBRARY}{SUFFIX}", how)


def build_stubs(stubs: Sequence[Path], build: Path, into: Path) -> None:
    """Compile and link the stubs: each module's, which only points into the library.

    Raises:
        CompileError: with the compiler's message.
    """
    names = [".".join(stub.relative_to(build).with_suffix("").parts) for stub in stubs]
    parts = compile_all(stubs, build, STUBS)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        made = [into / f"{name}{SUFFIX}" for name in names]
        list(pool.map(lambda part, file: link([part], file, STUBS), parts, made))


def compile_all(files: Sequence[Path], build: Path, how: Pass) -> list[Path]:
    """Compile what has changed; objects that nothing needs any more are removed.

    Raises:
        CompileError: with the compiler's message.
    """
    from mypyc.build import include_dir  # noqa: PLC0415 - see `lacking`

    include = ["-include", str(FAST_PATHS)]
    include += [f"-I{path}" for path in (sysconfig.get_path("include"), include_dir(), build)]
    runtime = sorted(Path(include_dir()).glob("*.[ch]"))
    flags = [*_FLAGS, *how.flags]
    headers = _digest([*build.rglob("*.h"), *runtime, FAST_PATHS], [*flags, *compiler()])
    objects = build / how.objects
    objects.mkdir(exist_ok=True)
    counts = counts_of(build)

    def compiled(file: Path) -> Path:
        read, where = [file], []
        if how.flags:  # Where GCC writes the counts, and finds them
            where = ["-dumpdir", f"{counts}/", "-dumpbase", file.name, "-dumpbase-ext", ".c"]
        if how is ARRANGED:
            read += counts.glob(f"{file.stem}.gcda")
        made = objects / f"{file.stem}-{_digest(read, [headers])}.o"
        if not made.exists():
            new = f"{made}.new"
            _run([*compiler(), *flags, *where, *include, "-c", str(file), "-o", new])
            Path(new).rename(made)
        return made

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        parts = list(pool.map(compiled, files))
    for old in set(objects.iterdir()) - set(parts):
        old.unlink()
    return parts


def link(parts: Sequence[Path], made: Path, how: Pass) -> None:
    """Make one library of objects.

    Raises:
        CompileError: with the linker's message.
    """
    _run([*compiler(), "-shared", *how.flags, *map(str, parts), "-lm", "-o", str(made)])


def counts_of(build: Path) -> Path:
    """Folder of the counts; a copy of the checkout may share it by a symbolic link."""
    return (build / "counts").resolve()


def is_gcc() -> bool:
    """Whether the compiler is GCC: others count in another way."""
    done = subprocess.run(  # noqa: S603 - ours
        [*compiler(), "--version"], capture_output=True, text=True, check=False
    )
    return "Free Software Foundation" in done.stdout


def count_in_flight(build: Path, made: Path) -> None:
    """Fly the counting library.

    Raises:
        CompileError: if it does not fly.
    """
    counts = counts_of(build)
    shutil.rmtree(counts, ignore_errors=True)
    counts.mkdir()
    # Not the build that is in use; and the same library counts the same every time
    variables = {"FARM_PURE": "1", "PYTHONHASHSEED": "0"}
    _run([sys.executable, "-m", "deploy.training_flight", str(made)], variables)


def _digest(files: Iterable[Path], texts: Iterable[str] = ()) -> str:
    digest = hashlib.sha256("\n".join(texts).encode())
    for file in sorted(files, key=lambda file: file.name):  # The same in another folder
        digest.update(file.read_bytes())
    return digest.hexdigest()[:24]


def _run(command: Sequence[str], variables: Mapping[str, str] = MappingProxyType({})) -> None:
    done = subprocess.run(  # noqa: S603 - ours
        command, capture_output=True, text=True, check=False, env={**os.environ, **variables}
    )
    if done.returncode != 0:
        raise CompileError(f"{command[0]} failed:\n{done.stderr}")


def compile_stack() -> int:
    """Compile, load every module once, and only then put the build in the old one's place."""
    paths, read = modules(), hashes()
    os.chdir(ROOT)
    files = translate(paths, BUILD)
    texts = repair([file.read_text("utf-8") for file in files.modules])
    for file, text in zip(files.modules, texts, strict=True):
        file.write_text(quicken(text), encoding="utf-8")
    made = BUILD / "made"
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir()
    names = [".".join(path.with_suffix("").parts) for path in paths]
    manifest = Manifest(abi(), names, read)
    (made / MANIFEST).write_text(json.dumps(manifest._asdict()), encoding="utf-8")
    build_stubs(files.stubs, BUILD, made)
    if is_gcc():
        build_library(files, BUILD, made, COUNTING)
        count_in_flight(BUILD, made)
        build_library(files, BUILD, made, ARRANGED)
    else:
        build_library(files, BUILD, made, PLAIN)
    if hashes() != read:
        raise CompileError("a source has changed in the meantime; compile again")
    shutil.rmtree(FOLDER, ignore_errors=True)
    shutil.move(made, FOLDER)
    _load(names)
    return len(paths)


def _load(names: Sequence[str]) -> None:
    """Import every module of the build in a process of its own.

    Raises:
        CompileError: if one cannot be imported; the build is then removed.
    """
    text = (
        "import importlib, uav_firmware.compiled as c; assert c.is_installed()\n"
        f"for name in {list(names)}: assert importlib.import_module(name).__file__[-3:] == '.so'"
    )
    try:
        _run([sys.executable, "-c", text])
    except CompileError as error:
        shutil.rmtree(FOLDER, ignore_errors=True)
        raise CompileError(f"a compiled module cannot be loaded: {error}") from error


def main(arguments: Sequence[str] = ()) -> int:
    """Compile; 0, or a sentence about what stands in the way."""
    argparse.ArgumentParser(
        prog="deploy.compile", description="Compile the flight stack with mypyc."
    ).parse_args(arguments)
    os.environ.pop("FARM_PURE", None)
    missing = lacking()
    if missing is not None:
        print(f"not compiled: {missing}", file=sys.stderr)
        return EXIT_NOT_EQUIPPED
    try:
        number = compile_stack()
    except CompileError as error:
        print(f"not compiled: {error}", file=sys.stderr)
        return EXIT_FAILED
    print(f"{number} modules compiled into {FOLDER.relative_to(ROOT)}; FARM_PURE=1 flies without")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
