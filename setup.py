# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The package as pip and colcon install it; name, version and maintainer come from package.xml.

rclpy and the message packages are no Python requirements here: they come with ROS 2, or from the
wheels that the Makefile installs.
"""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

# colcon runs this file through a symbolic link in its build folder.
ROOT = Path(__file__).resolve().parent


def files(pattern: str) -> list[str]:
    """Files that match, relative to the root, as `data_files` wants them."""
    return sorted(str(path.relative_to(ROOT)) for path in ROOT.glob(pattern) if path.is_file())


manifest = ElementTree.parse(ROOT / "package.xml").getroot()
maintainer = manifest.find("maintainer")
name = manifest.findtext("name")
scripts = files("scripts/*")

setup(
    name=name,
    version=manifest.findtext("version"),
    description=" ".join(manifest.findtext("description").split()),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get("email"),
    license=manifest.findtext("license"),
    python_requires=">=3.10",
    packages=find_packages(include=["dsse_ros", "dsse_ros.*", "msg_adapters", "msg_adapters.*"]),
    package_data={
        "dsse_ros": ["models/*"],
        "dsse_ros.screens.dashboard": ["*.css", "*.html", "*.js"],
        "dsse_ros.world.drift": ["*.csv"],
        "dsse_ros.results.report": ["*.html"],
        "dsse_ros.ros.runtime": ["fast_dds.xml"],
        "dsse_ros.world.sensors": ["*.csv"],
    },
    # The lower bounds admit what Ubuntu 24.04, the home of Jazzy and Kilted, has of these.
    install_requires=[
        "gymnasium>=1.1",
        "numba>=0.58.1",
        "numpy>=1.26",
        "pettingzoo>=1.25",
        "pymap3d>=3.0.1",
        "pymavlink>=2.4.41",
        "pyyaml>=6.0",
    ],
    extras_require={
        # Batches on a GPU: `vector_env(..., device="cuda")`. CUDA itself comes with its extra cu12
        # or cu13, or with the machine.
        "cuda": ["numba-cuda>=0.30"],
        # The solver of the planner `route`.
        "routes": ["ortools>=9.10"],
        # What the planner `onnx` runs models with.
        "onnx": ["onnxruntime>=1.17"],
        # What examples/train.py learns with, and exports the policy with.
        "train": ["onnxruntime>=1.17", "onnxscript>=0.2", "torch>=2.9"],
        # What `DroneVecEnv` is made for.
        "sb3": ["sb3-contrib>=2.4"],
        # Ground stations that the tests fly with. MAVProxy needs `future` without saying so; from
        # 1.8.75 on it brings 800 MB of 3D libraries.
        "sitl": ["MAVProxy>=1.8.71,<1.8.75", "future>=1.0", "mavsdk>=4.1,<5"],
        # What a scenario's fields of the same names need.
        "area": ["shapely>=2.0.3"],
        "land": ["roaring-landmask>=0.11"],
        # Wind and current from forecasts: grids, projections, units.
        "drift": [
            "cf-xarray>=0.9",
            "netCDF4>=1.6",
            "pint>=0.24",
            "pyproj>=3.6",
            "scipy>=1.11",
            "xarray>=2024.2",
        ],
        # Forecasts from GRIB files, beside `drift`. eccodes from 2.43 on loads a PROJ that crashes
        # pyproj's.
        "grib": ["eccodes>=2.37,<2.43"],
        # Forecasts from zarr stores, beside `drift`.
        "zarr": ["zarr>=2.18"],
        # Probability matrices from GeoTIFF files.
        "geotiff": ["rasterio>=1.4"],
        # The program `export_gis`, and areas from KML, GPX, shapefiles and GeoPackages.
        "gis": [
            "gpxpy>=1.6",
            "pyogrio>=0.10",
            "rasterio>=1.4",
            "shapely>=2.0.3",
        ],
        # What `recorder` and `replay` write and read.
        "record": ["lz4>=4.3", "mcap>=1.6", "zstandard>=0.21"],
        # The site of `make docs`.
        "docs": ["furo>=2024.8.6", "myst-parser>=4", "sphinx>=8.1", "sphinx-copybutton>=0.5"],
        # It brings an ffmpeg with it.
        "movie": ["imageio-ffmpeg>=0.5"],
        # What `foxglove_viewer` serves with.
        "viewer": ["foxglove-sdk>=0.22"],
        # What `cot_gateway` makes and sends events with, and areas.
        "tak": ["pytak>=7.6", "shapely>=2.0.3"],
        # The program `campaign`, and its engine on a cluster.
        "campaign": ["pyarrow>=15.0", "scipy>=1.11"],
        "ray": ["ray>=2.40"],
        # Libraries that take the environments, and in `make test-learning` those on PyTorch.
        "compat": ["pygame>=2.6", "SuperSuit>=3.9.3"],
        "learning": ["ray[rllib]>=2.40", "SuperSuit>=3.9.3", "torchrl>=0.7"],
        "viz": ["jinja2>=3.1", "matplotlib>=3.6", "tqdm>=4.66"],
        # The program `dashboard`; `browser` drives one in its tests, and checks its pages with axe.
        "dashboard": ["jinja2>=3.1", "nicegui>=3.18", "pillow>=10.2"],
        "browser": ["axe-playwright-python>=0.1.8", "playwright>=1.49"],
        # `make coverage`, `make mutants`, `make lock`, `make sbom` and `make audit`.
        "quality": [
            "coverage>=7.10",
            "cyclonedx-bom>=7",
            "mutmut>=3.8",
            "pip-audit>=2.9",
            "pytest-cov>=6",
            "uv>=0.9",
        ],
        # What guides the fuzzing of `make soak`.
        "soak": ["atheris>=3.0"],
        "test": [
            "colcon-common-extensions>=0.3",
            "hypothesis>=6.100",
            "mcap-ros2-support>=0.6",
            "mypy>=1.15",
            "onnx>=1.16",
            "pytest==8.3.*",
            "pytest-xdist>=3.8",
            "rosbags>=0.11",
            "ruff>=0.9",
            "setuptools>=70.1",
            "tifffile>=2024.8.30",
            "types-PyYAML",
            "websockets>=14.2",
        ],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml"]),
        *(
            (f"share/{name}/{sub}", files(f"{sub}/*"))
            for sub in ("config", "launch", "rviz", "viewers")
        ),
        (f"lib/{name}", scripts),
    ],
    entry_points={
        "console_scripts": [
            f"{program} = dsse_ros.cli.start:{program}"
            for program in (Path(file).name for file in scripts)
        ],
    },
    zip_safe=True,
)
