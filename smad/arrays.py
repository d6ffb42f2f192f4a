"""Types of numpy arrays: numbers in double and in single precision, masks, indices."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
