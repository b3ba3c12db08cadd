# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make sim`: from the command line to summary, picture and CSV."""

from __future__ import annotations

import csv
import io
import math
import os
import re
import signal
import stat
import struct
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from PIL import Image
from rig import TIMEOUT_S, Process, free_domain

from dsse_ros.cli import run_mission
from dsse_ros.ros.runtime.interrupts import Stop

SANTOS = Path(__file__).resolve().parents[2] / "config" / "santos.yaml"


def start(out: Path, *arguments: str, domain: int | None = None) -> Process:
    out.mkdir(parents=True, exist_ok=True)
    command = ["dsse_ros.cli.run_mission", "--scenario", str(SANTOS), "--out", str(out)]
    return Process([*command, *arguments], out / "console.log", domain or free_domain())


def end(run: Process) -> None:
    """End a mission that a failed test has left behind, with its nodes."""
    run.signal(signal.SIGINT)
    try:
        run.wait()
    except subprocess.TimeoutExpired:
        run.kill()


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def children(process: Process) -> dict[str, int]:
    """Return the process ids of the nodes that a mission has started, by name."""
    pid = process.child.pid
    found = {}
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        try:
            line = Path(f"/proc/{child}/cmdline").read_bytes().decode()
        except OSError:
            # It has just ended.
            continue
        match = re.search(r"import (\w+_node);", line)
        if match:
            found[match[1]] = int(child)
    return found


def gone(pid: int) -> bool:
    return not Path(f"/proc/{pid}").exists()


def rows(out: Path) -> list[dict[str, str]]:
    with (out / "mission.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A mission with a movie and one of another seed with a page, in an awkward folder."""
    base = tmp_path_factory.mktemp("missions")
    outs = [base / name for name in ("first", "it's #2: [other]")]
    options = (("3", "--movie", str(outs[0] / "movies" / "mission.gif")), ("4", "--view"))
    runs = [start(out, "--rate", "0", "--seed", *o) for out, o in zip(outs, options, strict=True)]
    try:
        for run in runs:
            assert run.wait() == 0, run.output
    finally:
        for run in runs:
            end(run)
    return outs


def test_another_seed_gives_another_csv(flown: list[Path]) -> None:
    first, other = ((out / "mission.csv").read_bytes() for out in flown)
    assert first != other


def test_the_summary_says_what_the_csv_says(flown: list[Path]) -> None:
    for out in flown:
        console, log = (out / "console.log").read_text(), rows(out)
        lines = re.findall(r"^  (\w[\w ]*?) {2,}(.+)$", console, re.MULTILINE)
        shown = dict(reversed(lines))
        drones = [row for row in log if row["agent"].startswith("drone")]
        last = [row for row in log if row["step"] == log[-1]["step"]]
        found = [row["found"] == "1" for row in last if row["agent"].startswith("person")]
        assert shown["end"].startswith("FOUND by drone" if all(found) else "not found")
        assert shown["steps"] == f"{log[-1]['step']} of 180"
        minutes, seconds = divmod(round(float(log[-1]["time_s"])), 60)
        assert shown["time at sea"] == f"{minutes} min {seconds} s"
        assert shown["drones"].startswith("4")
        flown_m: dict[str, float] = {}
        place: dict[str, tuple[float, float]] = {}
        for row in drones:
            here = float(row["east_m"]), float(row["north_m"])
            before = place.setdefault(row["agent"], here)
            flown_m[row["agent"]] = flown_m.get(row["agent"], 0) + math.dist(before, here)
            place[row["agent"]] = here
        each = ", ".join(f"{metres:.0f}" for metres in flown_m.values())
        assert shown["flown"] == f"{sum(flown_m.values()):.0f} m ({each})"
        assert shown["reward"].startswith(f"{sum(float(row['reward']) for row in drones):.1f} (")
        pos = float(drones[-1]["pos"])
        assert shown["POS"] == f"{pos:.1%}" and 0.0 < pos < 1.0
        assert shown["picture"] == str(out / "mission.png")
        assert console.count("Traceback") == 0


def test_the_progress_line_ends_where_the_mission_does(flown: list[Path]) -> None:
    for out in flown:
        lines = (out / "console.log").read_text().replace("\r", "\n")
        progress = re.findall(r"step (\d+)/180 .* (\d+ drones|over), POS ([\d.]+%)", lines)
        last = [row for row in rows(out) if row["agent"] == "drone0"][-1]
        assert progress[-1] == (last["step"], "over", f"{float(last['pos']):.1%}")


def test_a_mission_beside_one_that_is_over_fails_instead_of_reporting_that_one(
    tmp_path: Path,
) -> None:
    domain = free_domain()
    alone = {"scenario": SANTOS, "scenario.timestep_limit": 1, "command_timeout": 0.01}
    options = [part for name, value in alone.items() for part in ("-p", f"{name}:={value}")]
    command = ["dsse_ros.ros.nodes.sim_node", "--ros-args", *options]
    other = Process(command, tmp_path / "other.log", domain)
    try:
        until(lambda: "mission 1 over" in other.output)
        run = start(tmp_path / "out", domain=domain)
        assert run.wait() == 1
    finally:
        other.kill()
    assert "run_mission: another mission uses this ROS_DOMAIN_ID" in run.output
    assert "FOUND" not in run.output


def test_a_mission_with_a_page_says_where_it_is_and_takes_it_along(flown: list[Path]) -> None:
    text = (flown[1] / "console.log").read_text()
    assert re.match(r"page at http://127\.0\.0\.1:\d+/\?token=[\w-]{16,}\n", text)
    log = flown[1] / "dashboard.log"
    # Nobody else may read the token in it.
    assert stat.S_IMODE(log.stat().st_mode) == 0o600
    served = log.read_text()
    assert "Traceback" not in served and "page at" in served
    assert not (flown[0] / "dashboard.log").exists()


def test_the_browser_gets_the_token_by_a_file_that_nobody_else_can_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    file = tmp_path / "page.html"
    file.write_text("")
    run_mission.open_browser("http://127.0.0.1:8080/?token=secret&a=1", file)
    assert opened == [file.as_uri()]
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert "url=http://127.0.0.1:8080/?token=secret&amp;a=1" in file.read_text()


def test_the_page_stays_until_ctrl_c_if_somebody_at_a_terminal_watches(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stop = Stop()
    with subprocess.Popen(["sleep", "60"]) as page, ThreadPoolExecutor() as pool:
        monkeypatch.setattr("sys.stdin", io.StringIO())
        run_mission.stay(page, stop)
        monkeypatch.setattr("sys.stdin.isatty", lambda: True)
        staying = pool.submit(run_mission.stay, page, stop)
        with pytest.raises(TimeoutError):
            staying.result(0.3)
        stop.wanted = True
        staying.result(TIMEOUT_S)
        page.kill()


@pytest.mark.parametrize(
    ("arguments", "rate"), [([], 20.0), (["--view"], 3.0), (["--view", "--rate", "0"], 0.0)]
)
def test_people_can_follow_a_mission_with_a_page(arguments: list[str], rate: float) -> None:
    assert run_mission.parse(arguments).rate == rate


def test_a_movie_has_the_start_and_each_step(flown: list[Path]) -> None:
    path = flown[0] / "movies" / "mission.gif"
    steps = int(rows(flown[0])[-1]["step"])
    with Image.open(path) as movie:
        # The last frame stays for two seconds.
        assert movie.format == "GIF" and movie.n_frames == steps + 1
    assert f"movie                {path}" in (flown[0] / "console.log").read_text()


def test_the_picture_is_one(flown: list[Path]) -> None:
    for out in flown:
        data = (out / "mission.png").read_bytes()
        assert data[:8] == b"\x89PNG\r\n\x1a\n"
        width, height = struct.unpack(">II", data[16:24])
        assert 300 <= width <= 4000 and 300 <= height <= 4000
        assert len(data) > 10_000


def test_no_node_outlives_its_mission(tmp_path: Path) -> None:
    run = start(tmp_path, "--rate", "2")
    try:
        until(lambda: {"sim_node", "planner_node"} <= children(run).keys())
        nodes = children(run)
        run.signal(signal.SIGINT)
        assert run.wait() == 130, run.output
        until(lambda: all(gone(pid) for pid in nodes.values()))
        assert "Traceback" not in run.output
    finally:
        end(run)


def test_a_simulation_that_dies_ends_the_mission_with_code_1(tmp_path: Path) -> None:
    run = start(tmp_path, "--rate", "2")
    try:
        until(lambda: {"sim_node", "planner_node"} <= children(run).keys())
        nodes = children(run)
        os.kill(nodes["sim_node"], signal.SIGKILL)
        assert run.wait() == 1, run.output
        line = run.output.splitlines()[-1]
        assert line.startswith("run_mission: sim_node ended with code -9")
        until(lambda: gone(nodes["planner_node"]))
    finally:
        end(run)


def test_a_simulation_that_refuses_to_start_is_quoted(tmp_path: Path) -> None:
    (tmp_path / "mission.csv").mkdir()
    run = start(tmp_path)
    assert run.wait() == 1, run.output
    line = run.output.splitlines()[-1]
    assert line.startswith("run_mission: sim_node: record_file: ")
    assert line.endswith("Is a directory")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--scenario", "atlantis"], "scenario: 'atlantis' is not a file"),
        (["--scenario", "{file}"], "did you mean sigma?"),
        (["--num-drones", "0"], "num_drones must be an integer >= 1"),
        (["--num-drones", "401"], "at most 400"),
        (["--num-drones", "many"], "--num-drones"),
        (["--seed", "-1"], "seed must be an integer >= 0"),
        (["--seed", str(2**63)], "seed"),
        (["--rate", "nan"], "rate must be a finite number"),
        (["--rate", "-1"], "rate"),
        (["--planner", "oracle"], "expanding_square"),
        (["--rules", "v9"], "paper"),
        (["--out", "{file}"], "out: "),
        (["--movie", "mission.avi"], "movie must end in .gif or .mp4"),
        (["--movie", "{file}/mission.gif"], "movie: "),
        (["--no-such"], "--no-such"),
        (["--ros-args", "-p", "num_dornes:=3"], "did you mean num_drones?"),
        (
            ["--drones", "3"],
            "'--drones' is not a field of the options of run_mission; did you mean --num-drones?",
        ),
        (["--ros-args", "-p", "num_drones:=0"], "scenario.num_drones must be an integer"),
        (["--ros-args", "-p", "scenario.num_drones:=0"], "scenario.num_drones must be an integer"),
        (["--ros-args", "-p", "sigma:=3.0"], "did you mean scenario.sigma?"),
        (["--ros-args", "-p", "planner:=oracle"], "planner must be one of"),
        (["--ros-args", "-p", "scenario.sigma:=wide"], "scenario.sigma must be a finite number"),
        (["--ros-args", "--params-file", "/no/such"], "/no/such'. Error"),
        (["--ros-args", "--log-level", "loud"], "loud"),
    ],
)
def test_bad_input_is_refused_on_one_line_with_code_2(
    arguments: list[str], says: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file.yaml"
    file.write_text("sigmma: 1.0")
    given = ["--scenario", str(SANTOS), "--out", str(tmp_path / "out")]
    given += [argument.format(file=file) for argument in arguments]
    try:
        code = run_mission.main(given)
    except SystemExit as end:
        code = int(end.code or 0)
    output, errors = capfd.readouterr()
    assert (code, output) == (2, "")
    (line,) = errors.splitlines()
    assert line.startswith("run_mission: ") and says in line


def test_ros_arguments_count_for_all_and_the_same_seed_gives_the_same_csv(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(
        "/**: {ros__parameters: {seed: 7, of_others: 1, rules.profile: v1}}\n"
        "/**/planner_node: {ros__parameters: {planner: sweep, resend_period: 0.2}}"
    )
    options = ["--rate", "0", "--ros-args", "--params-file", str(file), "-r", "__ns:=/a"]
    options += [
        "-p",
        "scenario.timestep_limit:=9",
        "-p",
        "resend_period:=0.3",
        "--log-level",
        "warn",
    ]
    run = start(tmp_path, *options, "--", "--num-drones", "2")
    try:
        assert run.wait() == 0, run.output
    finally:
        end(run)
    assert "of 9\n" in run.output and "step 9/9 " in run.output.replace("\r", "\n")
    assert {row["agent"] for row in rows(tmp_path)} == {"drone0", "drone1", "person0"}
    assert "INFO" not in (tmp_path / "sim_node.log").read_text()
    plain = tmp_path / "plain"
    (tmp_path / "short.yaml").write_text(SANTOS.read_text().replace("180", "9"))
    named = [
        "--rate",
        "0",
        "--num-drones",
        "2",
        "--seed",
        "7",
        "--planner",
        "sweep",
        "--rules",
        "v1",
    ]
    other = start(plain, *named, "--scenario", str(tmp_path / "short.yaml"))
    try:
        assert other.wait() == 0, other.output
    finally:
        end(other)
    assert (tmp_path / "mission.csv").read_bytes() == (plain / "mission.csv").read_bytes()
