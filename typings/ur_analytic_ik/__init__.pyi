# What the package uses of ur-analytic-ik, whose wheels declare no types.
from ur_analytic_ik import ur5 as ur5
