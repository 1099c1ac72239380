//! A file of limits that explains each of its keys.

/// The text of the file. Lines that begin with `#:` are limits that are not in force.
pub const TEMPLATE: &str = r#"# Limits for `bead judge F.mcap --limits limits.toml`. All values are in SI units.

title = "Absorber, incoming inspection"

# How a value y with its expanded uncertainty U (95 %) is compared with a limit (JCGM 106):
#   "simple"              y must be within the limits (8.2)
#   "guarded-acceptance"  all of y ± U must be within the limits: few bad ones pass (8.3.2)
#   "guarded-rejection"   not all of y ± U may be beyond a limit: few good ones fail (8.3.3)
# A limit may have a rule of its own.
rule = "simple"

# Least number of strikes of each bead.
strikes = 1

# Absorbed energy, J, as measured by the accelerometer (estimate A). Every strike must be within min and max; one of
# the two is enough. `absorbed_predicted` is estimate B, from the force, and `incident_energy` the energy of the wave.
[[limit]]
quantity = "absorbed_measured"
min = 1e-9
max = 1e-3

# A over B. Errors that A and B share cancel in its uncertainty.
[[limit]]
quantity = "ratio"
min = 0.95
max = 1.05

# Highest force at the contact, N.
[[limit]]
quantity = "peak_force"
name = "blow"
max = 50.0

# Shock response spectrum of the intruder: maximax over natural frequency, against a mask. Between its points the
# mask is a straight line over the logarithms of both.
[[limit]]
quantity = "srs"
response = "absolute-acceleration"  # or "pseudo-velocity" (m/s), "relative-displacement" (m)
unit = "m/s²"                       # or "g", for an absolute acceleration
quality = 10.0                      # of the oscillators: 5 % of critical damping
per_octave = 12                     # natural frequencies in an octave
mask = [
    { frequency = 500.0, max = 1e4 },
    { frequency = 5000.0, max = 1e4 },
]

# Greatest acceleration of the intruder to either side, m/s².
#:[[limit]]
#:quantity = "peak_acceleration"
#:max = 5000.0

# Estimate B, and the energy of the incoming wave, J.
#:[[limit]]
#:quantity = "absorbed_predicted"
#:max = 1e-3
#:[[limit]]
#:quantity = "incident_energy"
#:min = 1e-9

# Frequency of the intruder's ringing, Hz. The bead sends no uncertainty of it.
#:[[limit]]
#:quantity = "ring_frequency"
#:min = 1500.0
#:max = 2000.0
#:beads = [8]                        # addresses of the beads that it applies to; without this key, all

# Change of a value from the first strike to the last, as a part of its mean: by the line through five strikes or more.
#:[[limit]]
#:quantity = "drift"
#:of = "absorbed_measured"           # or another value of a strike
#:min = -0.02
#:max = 0.02

# Energy that all beads of a row absorb, as a part of the energy that came to the first of them.
#:[[limit]]
#:quantity = "row_share"
#:min = 0.25
"#;
