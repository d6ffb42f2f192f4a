"""Wilson's score interval for shares."""

import math

Z95 = 1.959963984540054


def wilson(hits: float, total: int) -> tuple[float, float]:
    """95 % Wilson score interval of hits/total; `hits` may be fractional. (0, 1) without cases.

    Wilson (1927); Brown, Cai & DasGupta (2001).
    """
    if total == 0:
        return 0.0, 1.0
    share = hits / total
    bend = Z95**2 / total
    centre = (share + bend / 2) / (1 + bend)
    half = Z95 * math.sqrt(max(share * (1 - share), 0.0) / total + bend / (4 * total)) / (1 + bend)
    return max(0.0, centre - half), min(1.0, centre + half)
