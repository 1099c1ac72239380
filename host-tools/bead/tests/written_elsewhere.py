"""Writes the first strike of an exported table as NumPy, SciPy (MATLAB) and polars write it.

Arguments: the table, CSV.
"""

import sys

import numpy
import polars
import scipy.io

names = ["time_s", "force_n", "acceleration_mps2"]
table = polars.read_csv(sys.argv[1]).filter(polars.col("id") == 0).select(names)
columns = {name: table[name].to_numpy() for name in names}
numpy.save("rows.npy", numpy.stack(list(columns.values()), axis=1))
numpy.save("columns.npy", numpy.stack(list(columns.values()), axis=0).astype(">f8"))
numpy.save("force.npy", columns["force_n"])
others = {"operator": "A. Name", "rig": {"height_m": 0.1}, "z": 1j * columns["force_n"]}
scipy.io.savemat("packed.mat", {**columns, **others}, do_compression=True)
matrix = numpy.stack([columns["force_n"], columns["acceleration_mps2"]], axis=1)
scipy.io.savemat("matrix.mat", {"m": matrix, "Tinterval": 1e-5, **others})
table.write_csv("table.csv")
table.write_parquet("zstd.parquet", compression="zstd")
