# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`campaign`: planners x scenarios x seeds, played on all cores or a cluster, and reported."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from dsse_ros.base.fields import FieldError
from dsse_ros.cli.command_line import Parser, make_folder
from dsse_ros.results.campaign import report
from dsse_ros.results.campaign.chunks import Results, job
from dsse_ros.results.campaign.config import Campaign
from dsse_ros.results.campaign.engines import ENGINES, WorkerError
from dsse_ros.ros.runtime.exit_codes import FAILED, fail


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the command line's arguments."""
    parser = Parser(
        prog="campaign",
        description="Play planners on scenarios and seeds, and compare them. Run it again with "
        "the same folder to continue where it stopped.",
    )
    parser.add("config", type=Path, help="YAML file, see docs/campaign.md")
    parser.add("--out", type=Path, help="folder of the results, by default the file's name")
    return parser.parse_with_ros(argv, {})


def play(campaign: Campaign, results: Results) -> None:
    """Play what is missing.

    Raises:
        FieldError: If the engine has no cluster.
        ImportError: If the engine is not installed.
        OSError: If a chunk cannot be written.
        WorkerError: If a planner fails, or workers die over a chunk again and again.
    """
    chunks = campaign.chunks()
    left = results.missing(chunks)
    total = sum(chunk.count for chunk in chunks)
    done = total - sum(chunk.count for chunk in left)
    with tqdm(
        total=total, initial=done, desc="campaign", unit="mission", disable=None, smoothing=0.05
    ) as bar:
        if not left:
            return
        engine = ENGINES[campaign.settings.engine]
        for (chunk, *_), played in engine(
            [job(campaign, waiting) for waiting in left], campaign.settings
        ):
            results.keep(chunk, played)
            bar.update(chunk.count)


def main(argv: list[str] | None = None) -> int:
    """Play and report; returns the exit code, 2 for bad input, 3 where missions or files fail."""
    arguments = parse(argv)
    try:
        campaign = Campaign.from_yaml(arguments.config)
        out = arguments.out or Path(arguments.config.stem)
        make_folder("out", out)
        with Results(out, campaign) as results:
            play(campaign, results)
            path = report.write(campaign, results.collect(), out)
    except FieldError as error:
        return fail("campaign", error)
    except WorkerError as error:
        fail("campaign", error)
        return FAILED
    except OSError as error:
        fail("campaign", f"out: {error.filename or str(out)!r}: {error.strerror or error}")
        return FAILED
    print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
