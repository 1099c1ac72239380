"""Opens what `bead export` and a recording hold with pandas, polars, pyuff, xarray and mcap, and compares every bit.

Arguments: the recording, the folder with the exported files, a JSON file with what the recording holds.
"""

import json
import sys

import numpy
import pandas
import polars
import pyuff
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

recording, folder, expected = sys.argv[1:]
with open(expected, encoding="utf-8") as file:
    expected = json.load(file)


def same(what, found, wanted):
    found, wanted = numpy.asarray(found), numpy.asarray(wanted)
    if found.dtype.kind == "f":
        found, wanted = found.astype("<f8").view("<i8"), wanted.astype("<f8").view("<i8")
    assert found.shape == wanted.shape and (found == wanted).all(), what


for form, frames in {
    "pandas, Parquet": [pandas.read_parquet(f"{folder}/{name}.parquet") for name in ("strikes", "samples")],
    "pandas, CSV": [pandas.read_csv(f"{folder}/{name}.csv") for name in ("strikes", "samples")],
    "polars, Parquet": [polars.read_parquet(f"{folder}/{name}.parquet") for name in ("strikes", "samples")],
    "polars, CSV": [polars.read_csv(f"{folder}/{name}.csv") for name in ("strikes", "samples")],
}.items():
    for table, frame in zip(("strikes", "samples"), frames):
        assert list(frame.columns) == expected["columns"][table], form
        for column, wanted in expected[table].items():
            same(f"{form}: {column}", frame[column].to_numpy(), wanted)
    print(f"{form}: {frames[0].shape[0]} strikes, {frames[1].shape[0]} samples, equal in every bit")

samples = pandas.read_parquet(f"{folder}/samples.parquet")
cube = samples.set_index(["id", "sample"])[["force_n", "acceleration_mps2"]].to_xarray()
same("xarray", cube["force_n"].to_numpy().ravel(), expected["samples"]["force_n"])
print(f"xarray: {dict(cube.sizes)}, equal in every bit")

functions = [each for each in pyuff.UFF(f"{folder}/strikes.uff").read_sets() if each["type"] == 58]
for first, column, unit, bits in ((0, "force_n", "N", 16), (1, "acceleration_mps2", "m/s^2", 12)):
    own = functions[first::2]
    assert all(each["ordinate_axis_units_lab"] == unit for each in own)
    values = numpy.concatenate([each["data"] for each in own])
    # A multiple of 2^-bits, told with thirteen digits.
    same(f"pyuff: {column}", numpy.round(values * 2**bits) / 2**bits, expected["samples"][column])
    times = numpy.concatenate([each["x"] for each in own])
    assert numpy.abs(times - numpy.asarray(expected["samples"]["time_from_trigger_s"])).max() < 1e-12
print(f"pyuff: {len(functions)} functions, equal in every bit of the bead's formats")

with open(recording, "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    said = [(channel.topic, message) for _, channel, _, message in reader.iter_decoded_messages(topics=["strikes", "waveforms"])]
strikes = [message for topic, message in said if topic == "strikes"]
for column in ("peak_force_n", "absorbed_measured_j", "absorbed_predicted_j", "trigger_index"):
    same(f"mcap: {column}", [getattr(strike, column) for strike in strikes], expected["strikes"][column])
for column in ("force_n", "acceleration_mps2"):
    found = numpy.concatenate([getattr(message, column) for topic, message in said if topic == "waveforms"])
    same(f"mcap: {column}", found, numpy.asarray(expected["samples"][column], "<f4").astype("<f8"))
print(f"mcap: {len(strikes)} strikes with their waveforms, equal in every bit")
