"""The package against the command line, and what goes wrong in it.

`BEAD` is the program `bead`, `REPOSITORY` the folder of the project. `cargo xtask wheel` sets both.
"""

import contextlib
import csv
import io
import json
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import polars

import hertz_chain as hc

BEAD = os.environ["BEAD"]
REPOSITORY = Path(os.environ["REPOSITORY"])
RECORDING = REPOSITORY / "tests/data/recording-v1.mcap"
PAPER = REPOSITORY / "docs/scenarios/paper-strike.toml"


def bead(*words, status=0):
    """Standard output of `bead`, or its line of failure."""
    ran = subprocess.run([BEAD, *map(str, words)], capture_output=True, text=True, check=False)
    assert ran.returncode == status, ran.stderr
    return ran.stderr.strip() if status else ran.stdout


def columns(path):
    """The columns of a CSV table as texts."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return {name: [row[at] for row in rows[1:]] for at, name in enumerate(rows[0])}


def same(ours, theirs):
    """True if values equal the texts of a table, which are exact."""
    if isinstance(ours, list):
        return [one or "" for one in ours] == theirs
    numbers = np.array([float(text) if text else np.nan for text in theirs])
    return np.array_equal(ours.astype(float), numbers, equal_nan=True)


def absorbed(velocity):
    """The energy that the paper's intruder takes of a strike, J, by an ensemble of a few."""
    scenario = hc.Scenario.paper().replace(striker={"velocity": velocity})
    return float(hc.ensemble([scenario] * 16).absorbed[0])


class AgainstTheCommandLine(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def test_a_run_has_the_bits_of_simulate(self):
        out = self.folder / "run.csv"
        summary = json.loads(bead("simulate", PAPER, "--out", out, "--format", "json"))
        run = hc.simulate(hc.Scenario.load(PAPER))
        table = columns(out)
        pairs = {"time_s": run.time, "striker_energy_j": run["striker_energy"], "chain_energy_j": run["chain_energy"]}
        pairs |= {f"contact_{contact}_force_n": run["force"][:, contact - 1] for contact in run.contacts}
        pairs["bead_8_intruder_acceleration_mps2"] = run["intruder_acceleration"][:, 0]
        for name, ours in pairs.items():
            self.assertTrue(same(ours, table[name]), name)
        for key in ("peak_force", "energy", "intruders", "final"):
            self.assertEqual(run.summary[key], summary[key])
        self.assertEqual(list(run.intruders), [8])

    def test_a_branch_has_the_bits_of_periodic(self):
        trimer = REPOSITORY / "docs/scenarios/driven-trimer.toml"
        line = ("periodic", trimer, "--along", "amplitude", "--to", "3e-8", "--format", "json")
        theirs = json.loads(bead(*line))
        ours = hc.periodic(hc.Scenario.load(trimer), along="amplitude", to=3e-8)
        points = theirs["branch"]["points"]
        self.assertEqual((ours.end, len(ours.amplitude)), (theirs["branch"]["end"], len(points)))
        for name in ("amplitude", "stable", "bifurcation"):
            self.assertEqual(list(getattr(ours, name)), [point[name] for point in points], name)
        for name, key in (("force_min", "force_min_n"), ("force_max", "force_max_n"), ("speed_max", "speed_max_mps")):
            self.assertTrue(np.array_equal(getattr(ours, name), [point[key] for point in points]), name)
        first = [complex(one["re"], one["im"]) for one in theirs["multipliers"]]
        self.assertEqual(list(ours.multipliers[0]), first)
        alone = hc.periodic(hc.Scenario.load(trimer))
        self.assertTrue(alone.end is None and alone.multipliers.shape == (1, 42) and alone.residual[0] < 1e-10)

    def test_a_sweep_has_the_bits_of_sweep(self):
        definition = {
            "scenario": hc.Scenario.paper().to_dict(),
            "axis": [
                {"key": "intruder.1.stiffness", "logspace": [1e5, 1e6, 3]},
                {"key": "striker.velocity", "values": [0.3, 1.0]},
            ],
            "outputs": {"peaks": [8]},
        }
        path, out = self.folder / "sweep.toml", self.folder / "sweep.parquet"
        axes = "\n".join(
            "[[axis]]\n" + "\n".join(f"{key} = {json.dumps(value)}" for key, value in axis.items())
            for axis in definition["axis"]
        )
        path.write_text(f'scenario = "{PAPER}"\n{axes}\n[outputs]\npeaks = [8]\n')
        bead("sweep", path, "--out", out)
        theirs = polars.read_parquet(out)
        for found in (hc.sweep(path), hc.sweep(definition)):
            self.assertEqual(list(found.columns), theirs.columns)
            for name, ours in found.columns.items():
                self.assertEqual(list(ours), theirs[name].to_list(), name)
        own = hc.sweep(
            scenario=hc.Scenario.paper(),
            axes={"intruder.1.stiffness": np.geomspace(1e5, 1e6, 3), "striker.velocity": [0.3, 1.0]},
        )
        np.testing.assert_allclose(own.columns["absorbed_j"], found.columns["absorbed_j"], rtol=1e-7)
        scenarios = [
            hc.Scenario.paper().replace(
                intruder=[{**hc.Scenario.paper().to_dict()["intruder"][0], "stiffness": float(stiffness)}],
                striker={"velocity": float(velocity)},
            )
            for stiffness, velocity in zip(
                own.columns["intruder_1_stiffness_n_per_m"], own.columns["striker_velocity_mps"], strict=True
            )
        ]
        together = hc.ensemble(scenarios, peaks=[8])
        self.assertTrue(np.array_equal(together.absorbed, own.columns["absorbed_j"]))
        cube = own.to_xarray()
        self.assertEqual(cube["absorbed_j"].shape, (3, 2))
        self.assertEqual(cube["absorbed_j"].attrs["units"], "J")

    def test_a_recording_has_the_tables_and_the_budget_of_the_command_line(self):
        bead("export", RECORDING, "--out", self.folder, "--format", "csv")
        recording = hc.Recording(RECORDING)
        for name, ours in (("strikes", recording.strikes()), ("samples", recording.samples())):
            theirs = columns(self.folder / f"{name}.csv")
            self.assertEqual(list(ours), list(theirs))
            for column, values in ours.items():
                self.assertTrue(same(values, theirs[column]), f"{name}: {column}")
        self.assertEqual(len(recording.strikes_pandas()), len(recording.strikes_polars()))

    def test_a_recording_of_today_is_replayed_and_has_its_budget_and_clocks(self):
        out = self.folder / "run"
        bead("emulate", PAPER, "--bead", 8, "--strikes", 2, "--out", out)
        path = out / "bead-8.mcap"
        recording = hc.Recording(path)
        self.assertEqual(recording.replay()["replay"], ["identical"] * 2)
        theirs = json.loads(bead("budget", path, "--strike", 1, "--format", "json"))["beads"][0]
        self.assertEqual(recording.budget(1), theirs)
        theirs = json.loads(bead("compare", path, "--format", "json"))
        ours = recording.compare()
        self.assertTrue(ours["pass"])
        self.assertEqual(ours, {key: theirs[key] for key in ours})
        self.assertFalse(recording.compare(hc.Scenario.paper().replace(striker={"velocity": 0.4}))["pass"])
        clocks = json.loads(bead("clock", path, "--format", "json"))
        self.assertEqual(recording.clocks().keys() - clocks.keys(), set())
        theirs = json.loads(bead("identify", path, "--scenario", PAPER, "--fit", "k,c", "--format", "json"))
        ours = recording.identify(hc.Scenario.load(PAPER), fit=["k", "c"])
        self.assertEqual(ours, {key: theirs[key] for key in ours})
        one = recording.identify(hc.Scenario.load(PAPER), strikes=[1])["beads"][0]
        self.assertEqual([strike["strike"] for strike in one["strikes"]], [1])

        # Behind a longer quiet the arithmetic gives the same bits of the same samples.
        for strike in range(2):
            samples = recording.samples(strike)
            names = ("force_code", "force_wide_code", "acceleration_code", "acceleration_wide_code")
            codes = np.stack([np.nan_to_num(samples[name]).astype(int) for name in names], axis=1)
            estimator = hc.Estimator()
            quiet = np.tile(codes[:64], (12, 1))
            for part in np.array_split(np.concatenate([quiet, codes, quiet]), 7):
                ended = estimator.process(part)["strikes"]
                if len(ended["id"]):
                    found = ended
            strikes = recording.strikes()
            for name in ("absorbed_measured_raw", "absorbed_predicted_raw", "peak_force_raw"):
                self.assertEqual(found[name][0], strikes[name][strike], name)

    def test_a_row_is_compared_as_a_whole(self):
        scenario = REPOSITORY / "docs/scenarios/ten-intruders.toml"
        bead("emulate", scenario, "--bead", "7,8", "--out", self.folder / "row")
        path = self.folder / "row/chain.mcap"
        theirs = json.loads(bead("compare", path, "--format", "json"))
        recording = hc.Recording(path)
        ours = recording.compare()
        self.assertTrue(ours["pass"])
        self.assertEqual(ours, {key: theirs[key] for key in ours})
        self.assertEqual(recording.compare(bead=8)["bead"], 8)

    def test_messages_are_those_of_the_command_line(self):
        path = self.folder / "wrong.toml"
        for text in ("duration = 6e-3\n", PAPER.read_text().replace("radius", "radios", 1), "x"):
            path.write_text(text)
            with self.assertRaises(hc.ScenarioError) as raised:
                hc.Scenario.load(path)
            self.assertEqual(bead("simulate", path, status=2), f"bead: {raised.exception}")


class Inputs(unittest.TestCase):
    def refused(self, part, call, kind=hc.ScenarioError):
        with self.assertRaises(kind) as raised:
            call()
        text = str(raised.exception)
        self.assertIn(part, text)
        self.assertNotIn("\n", text)

    def test_scenarios_from_dictionaries_name_their_key(self):
        paper = hc.Scenario.paper()
        self.assertEqual(hc.Scenario.from_dict(paper.to_dict()), paper)
        self.assertEqual(hc.Scenario.from_toml(paper.to_toml()), paper)
        self.assertEqual(pickle.loads(pickle.dumps(paper)), paper)
        self.assertEqual(paper.replace(duration=5e-05).to_dict()["duration"], 5e-05)
        for part, change in (
            ("TOML has no null", {"striker": {"velocity": None}}),
            ("did you mean `velocity`", {"striker": {"velocit": 1.0}}),
            ("where a number belongs", {"striker": {"velocity": "0.8 m/s"}}),
            ("infinite or not a number", {"striker": {"velocity": float("nan")}}),
            ("infinite or not a number", {"duration": np.float64("inf")}),
            ("radius", {"chain": {"radius": -1.0}}),
        ):
            self.refused(part, lambda change=change: paper.replace(**change))
        self.refused("is not a value of a scenario", lambda: paper.replace(duration=object()), TypeError)
        self.refused("is not an observable", lambda: hc.simulate(paper, observables=["forces"]))
        self.refused("give a rate in Hz", lambda: hc.simulate(paper, rate=float("nan")))
        self.refused("give a rate in Hz", lambda: hc.simulate(paper, rate=1e15))
        self.refused("tolerance", lambda: hc.simulate(paper, tolerance=1.0))
        self.refused("no scenario has a contact 99", lambda: hc.ensemble([paper], peaks=[99]))
        self.refused("give a sweep's file or tables", hc.sweep)
        self.refused("bead", lambda: hc.optimise(paper, [40], 5e-3))
        self.refused("a chain without a drive has no period", lambda: hc.periodic(paper))
        self.refused("is neither amplitude nor", lambda: hc.periodic(paper, along="phase", to=1.0))
        self.refused("or neither", lambda: hc.periodic(paper, along="amplitude"))

    def test_arrays_of_another_shape_or_kind_are_refused(self):
        estimator = hc.Estimator()
        for part, codes in (
            ("give (n, 4)", np.zeros(4, np.uint16)),
            ("give (n, 4)", np.zeros((4, 3), np.uint16)),
            ("outside 0 to 4095", np.full((4, 4), 4096)),
            ("outside 0 to 4095", np.full((4, 4), -1)),
        ):
            self.refused(part, lambda codes=codes: estimator.process(codes))
        self.refused("give integers", lambda: estimator.process(np.zeros((4, 4))), TypeError)
        self.refused("give a force", lambda: hc.Estimator.digitise(rate=1e6))
        self.refused("not numbers", lambda: hc.Estimator.digitise([np.nan], rate=1e6))
        self.refused("give (n,)", lambda: hc.Estimator.digitise(np.zeros((3, 2)), rate=1e6))
        self.refused("rate", lambda: hc.Estimator.digitise([0.0], rate=0.0))
        self.refused("missing.toml", lambda: hc.Estimator("missing.toml"))
        self.refused("missing.mcap", lambda: hc.Recording("missing.mcap"), hc.RecordingError)
        self.refused("there is no strike 9", lambda: hc.Recording(RECORDING).samples(9), hc.RecordingError)
        self.refused("there is no strike 9", lambda: hc.Recording(RECORDING).budget(9), hc.RecordingError)
        for part, wanted in (
            ("'chain' simulates the chain", {"method": "chain"}),
            ("leave out one of them", {"method": "pairs", "scenario": hc.Scenario.paper()}),
            ("is not one of 'ring_down'", {"method": "taps"}),
            ("neither 'free' nor 'held'", {"mounting": "loose"}),
            ("is not one of k, c", {"fit": ["q"]}),
        ):
            self.refused(part, lambda wanted=wanted: hc.Recording(RECORDING).identify(**wanted), ValueError)

    def test_a_callback_ends_a_search_and_its_exception_comes_through(self):
        found = hc.optimise(hc.Scenario.paper(), [8], 5e-3, callback=lambda designs, best, descents: designs < 100)
        self.assertTrue(found.report["stopped"] and 0.0 < found.share < 1.0)
        free = found.report["strokes_m"][0]
        found = hc.optimise(hc.Scenario.paper(), [8], 5e-3, stroke=0.5 * free, evaluations=1000)
        self.assertTrue(0.25 * free < found.report["strokes_m"][0] <= 0.5 * free)
        springs = REPOSITORY / "docs/scenarios/springs.toml"
        found = hc.optimise(hc.Scenario.paper(), [7, 8], 5e-3, catalogue=springs, hosts_at_most=1, evaluations=1000)
        (spring,) = found.report["springs"]["springs"]
        (intruder,) = found.scenario.to_dict()["intruder"]
        self.assertEqual(spring["stiffness"], intruder["stiffness"])
        found = hc.optimise(hc.Scenario.paper(), [8], 5e-3, radii=(range(10, 13), 0.015, 0.02), evaluations=1000)
        sizes = {section["beads"][0]: section["radius"] for section in found.scenario.to_dict()["section"]}
        self.assertEqual(sizes, {one["bead"]: one["radius_m"] for one in found.report["radii"]})
        self.assertTrue(all(0.015 <= radius <= 0.02 for radius in sizes.values()) and len(sizes) == 3)

        def fails(*_):
            raise ZeroDivisionError("mine")

        with self.assertRaisesRegex(ZeroDivisionError, "mine"):
            hc.optimise(hc.Scenario.paper(), [8], 5e-3, callback=fails)
        with self.assertRaisesRegex(ZeroDivisionError, "mine"):
            hc.ensemble([hc.Scenario.paper()], progress=fails)
        trimer = hc.Scenario.load(REPOSITORY / "docs/scenarios/driven-trimer.toml")
        with self.assertRaisesRegex(ZeroDivisionError, "mine"):
            hc.periodic(trimer, along="amplitude", to=4e-8, callback=fails)
        stopped = hc.periodic(trimer, along="amplitude", to=4e-8, callback=lambda value: value < 2e-9)
        self.assertEqual((stopped.end, (stopped.amplitude >= 2e-9).sum()), ("stopped", 1))


class Threads(unittest.TestCase):
    def test_ctrl_c_ends_long_work_within_two_seconds(self):
        # A program in the background of a script ignores it.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)
        long = hc.Scenario.paper().replace(duration=1000.0, chain={"beads": 400})
        many = [hc.Scenario.paper()] * 400_000
        for work in (
            lambda: hc.simulate(long, observables=[]),
            lambda: hc.ensemble(many),
            lambda: hc.optimise(hc.Scenario.paper(), list(range(4, 16)), 30e-3),
        ):
            timer = threading.Timer(0.4, lambda: signal.raise_signal(signal.SIGINT))
            timer.start()
            begun = time.monotonic()
            with self.assertRaises(KeyboardInterrupt):
                work()
            self.assertLess(time.monotonic() - begun, 2.4)

    def test_a_forked_process_has_threads_of_its_own(self):
        import multiprocessing

        expected = absorbed(0.5)
        with multiprocessing.get_context("fork").Pool(2) as pool:
            found = pool.map_async(absorbed, [0.5, 0.8]).get(timeout=60)
        self.assertEqual(found[0], expected)

    def test_threads_take_turns_at_one_estimator(self):
        estimator, codes = hc.Estimator(), np.full((200_000, 4), 2048)
        failed = []

        def work():
            try:
                estimator.process(codes)
            except Exception as error:
                failed.append(error)

        threads = [threading.Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(failed, [])

    def test_other_threads_run_meanwhile(self):
        counted = 0
        stop = threading.Event()

        def count():
            nonlocal counted
            while not stop.is_set():
                counted += 1
                time.sleep(1e-3)

        thread = threading.Thread(target=count)
        thread.start()
        hc.ensemble([hc.Scenario.paper()] * 20_000)
        stop.set()
        thread.join()
        self.assertGreater(counted, 10)


class Examples(unittest.TestCase):
    def test_the_lines_of_the_readme_draw_fig_2a(self):
        import matplotlib

        matplotlib.use("Agg")
        for page in ("README.md", "host-tools/python/README.md"):
            block = re.search(r"```python\n(.*?)```", (REPOSITORY / page).read_text(), re.DOTALL)
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile(block[1], page, "exec"), {})
            self.assertEqual(printed.getvalue().strip(), "[6.6016 6.4822 6.3834 6.2967 6.2173 6.1425]")
            self.assertEqual(len(matplotlib.pyplot.gca().lines), 6)
            matplotlib.pyplot.close("all")

    def test_the_programs_of_the_page_run(self):
        import matplotlib

        matplotlib.use("Agg")
        page = (REPOSITORY / "docs/python.md").read_text()
        blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
        self.assertEqual(len(blocks), 5)
        with tempfile.TemporaryDirectory() as folder:
            self.addCleanup(os.chdir, Path.cwd())
            os.chdir(folder)
            Path("docs").symlink_to(REPOSITORY / "docs")
            bead("emulate", PAPER, "--bead", 8, "--out", "run")
            for number, block in enumerate(blocks):
                printed = io.StringIO()
                with contextlib.redirect_stdout(printed):
                    exec(compile(block, f"python.md, program {number}", "exec"), {})
                if number in (0, 1, 3):
                    self.assertIn(f"```text\n{printed.getvalue()}```", page)
                if number == 0:
                    # docs/validation.md has 96.75 % of the chain's energy as the paper prints it.
                    self.assertIn("2.7 g: one leaves 96.7", printed.getvalue())
                if number == 1:
                    found = re.findall(r"(\d+\.\d) ± (\d+\.\d) nJ", printed.getvalue())
                    for energy, expanded in found:
                        self.assertAlmostEqual(float(energy), 829.7, delta=4.0)
                        self.assertTrue(30.0 < float(expanded) < 45.0)
                    self.assertEqual(len(found), 2)
        matplotlib.pyplot.close("all")

    def test_the_notebooks_are_those_of_the_page(self):
        sys.path.insert(0, str(REPOSITORY / "host-tools/python"))
        import notebooks

        found = list(notebooks.sections())
        self.assertEqual([name for name, *_ in found], list(notebooks.NAMES.values()))
        for name, heading, text, program in found:
            kept = REPOSITORY / "docs/notebooks" / name
            how = "python host-tools/python/notebooks.py docs/notebooks"
            self.assertEqual(kept.with_suffix(".py").read_text(), notebooks.script(heading, text, program), how)
            cells = json.loads(kept.with_suffix(".ipynb").read_text())["cells"]
            self.assertEqual("".join(cells[1]["source"]), program, how)
            self.assertTrue(cells[1]["outputs"][0]["text"], how)

    def test_no_rust_is_needed(self):
        import shutil

        self.assertIsNone(shutil.which("cargo"))

    def test_observables_have_units_in_xarray(self):
        dataset = hc.simulate(hc.Scenario.paper(), rate=1e5).to_xarray()
        self.assertEqual(dataset["force"].attrs["units"], "N")
        self.assertEqual(dataset["force"].sel(contact=8).shape, (601,))
        self.assertAlmostEqual(dataset.attrs["dissipated_intruders_j"], 8.297e-7, delta=1e-10)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
