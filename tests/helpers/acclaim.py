"""A body of three bones and its motion, as ASF and AMC."""

ASF = """\
# made by hand
:version 1.10
:name figure
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   begin of the story
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name thigh
     direction 1 0 0
     length 10
     axis 0 0 90 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name knee
     direction 0 -1 0
     length 5
     axis 0 0 0 XYZ
    dof rx
    limits (-10.0 170.0)
  end
  begin
     id 3
     name stiff
     direction 0 0 1
     length 2
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root thigh
    thigh knee
    knee stiff
  end
"""
AMC = """\
# made by hand
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
thigh 0 0 0
knee 0
2
root 1 2 3 0 0 0
thigh 90 0 0
knee 90
"""
