"""Files of photometry (IESNA LM-63), one of each year, written by hand."""

import numpy as np

OF_1986 = """A LUMINAIRE OF THE FIRST YEAR
  two lines of any words, since labels had no form
TILT=NONE
2 1500 1 3 1 1 1 0.5 2 0
0.9 0.5 60
0 45 90
0
100 80 20
"""

OF_1991 = """IESNA91
[TEST] 12
[MANUFAC] none
[MORE] and more of it
TILT=INCLUDE
1
3
0 45 90
1 1 1
1 1000 2 2 2 1 2 0 0 0
1 0.5 75
0 180
0 90
10 20
30 40
"""

OF_1995 = """IESNA:LM-63-1995
[TEST] 12
[BLOCK]
[LAMPCAT] with a degree sign: \xb0
[ENDBLOCK]
TILT=NONE
1,1000,0.5 3 3 1 2 -0.3 -0.3 0
0.8, 0.9, 75
0 30
90 90
180 270 10,20,30
40
50 60 70 80 90"""

OF_2002 = """IESNA:LM-63-2002
[TEST] 12
[TESTLAB] none
[ISSUEDATE] 01-JAN-2003
[MANUFAC] none
TILT=NONE
1 -1 1 2 4 1 2 0 0 0
0.5 7 75
0 180
0 30 60 90
1 2 3 4 5 6 7 8
"""

OF_2019 = OF_2002.replace("IESNA:LM-63-2002", "IES:LM-63-2019").replace("0.5 7", "0.5 1.1")

FOOT = 0.3048

READ = {
    "1986": (OF_1986, [0, 45, 90], [0], 0.45 * np.array([[100, 80, 20]]), (0.5, 2, 0), FOOT),
    "1991": (OF_1991, [0, 180], [0, 90], [[10, 20], [30, 40]], (0, 0, 0), 1),
    "1995": (
        OF_1995, [0, 30, 90], [90, 180, 270], 0.4 * np.arange(10, 91, 10).reshape(3, 3),
        (-0.3, -0.3, 0), 1,
    ),
    "2002": (OF_2002, [0, 180], [0, 30, 60, 90], 0.5 * np.arange(1, 9).reshape(4, 2), (0, 0, 0), 1),
    "2019": (OF_2019, [0, 180], [0, 30, 60, 90], 0.5 * np.arange(1, 9).reshape(4, 2), (0, 0, 0), 1),
}  # fmt: skip
"""By year: the file, its angles, candelas and opening, and its unit in metres."""
