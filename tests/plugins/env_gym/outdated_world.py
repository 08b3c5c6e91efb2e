"""Asks a package for what its present version does not have, when it is imported."""

import numpy

FLOAT = numpy.a_type_of_1998
