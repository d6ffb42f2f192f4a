"""One linear-Gaussian kit for parameters, places, laws, series and effects."""
