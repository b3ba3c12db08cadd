# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""package.xml, the changelog and the files for launch and RViz, as ROS tools read them."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.cli.tag_changelog import get_forthcoming_label
from catkin_pkg.package import Package, parse_package

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def manifest() -> Package:
    return parse_package(str(ROOT))


def test_the_manifest_is_valid_without_a_warning() -> None:
    warnings: list[str] = []
    parse_package(str(ROOT), warnings=warnings).validate(warnings)
    assert warnings == []


def test_colcon_takes_it_for_an_ament_package_of_format_3(manifest: Package) -> None:
    assert manifest.package_format == 3
    assert manifest.get_build_type() == "ament_python"


def test_pip_knows_the_name_and_version_of_the_manifest(manifest: Package) -> None:
    command = [sys.executable, "setup.py", "--name", "--version"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=180).stdout
    assert printed.split() == [manifest.name, manifest.version]


@pytest.mark.slow
def test_every_ros_package_that_is_imported_is_a_dependency(manifest: Package) -> None:
    imported = set()
    for file in (*ROOT.glob("dsse_ros/**/*.py"), *ROOT.glob("msg_adapters/**/*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                imported.add(node.module.split(".")[0])
    suffixes = ("_interfaces", "_msgs", "_srvs")
    ros = {name for name in imported if name == "rclpy" or name.endswith(suffixes)}
    assert "rclpy" in ros
    assert ros <= {dependency.name for dependency in manifest.exec_depends}


def test_the_licence_of_the_manifest_is_the_one_in_the_tree(manifest: Package) -> None:
    assert manifest.licenses == ["Apache-2.0"]
    assert manifest.licenses[0].file == "LICENSE"
    assert "Apache License" in (ROOT / "LICENSE").read_text()


def test_the_citation_is_of_the_package_in_the_manifest(manifest: Package) -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert citation["title"] == manifest.name
    assert citation["license"] == manifest.licenses[0]
    assert [author["name"] for author in citation["authors"]] == [
        maintainer.name for maintainer in manifest.maintainers
    ]
    assert citation["abstract"] == " ".join(manifest.description.split())


@pytest.mark.filterwarnings("ignore:nodes.Node.traverse")
def test_the_changelog_is_one_that_ros_tools_read(manifest: Package) -> None:
    changelog = get_changelog_from_path(str(ROOT), manifest.name)
    released = {version for version, _, _ in changelog.foreach_version()}
    assert manifest.version in released or get_forthcoming_label(changelog.rst)


@pytest.mark.parametrize("file", sorted((ROOT / "launch").iterdir()), ids=lambda path: path.name)
def test_a_launch_file_describes_a_launch(file: Path) -> None:
    module = ast.parse(file.read_text(), filename=str(file))
    compile(module, str(file), "exec")
    assert "generate_launch_description" in {getattr(node, "name", "") for node in module.body}


def test_the_launch_files_start_only_executables_that_exist() -> None:
    sources = [*(ROOT / "launch").iterdir(), ROOT / "dsse_ros" / "ros" / "nodes" / "launching.py"]
    started = {
        name
        for path in sources
        for name in re.findall(r'\bnode\(\s*context, "(\w+)"', path.read_text())
    }
    assert {"sim_node", "planner_node", "mavlink_bridge"} <= started
    assert started - {"rviz2"} <= {path.name for path in (ROOT / "scripts").iterdir()}
