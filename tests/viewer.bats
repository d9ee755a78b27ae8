# vkt render in a window: needs a virtual display (Xvfb) and somebody who moves its mouse (xdotool).
load helper
load display

volume=block_24x18x30_uint8.raw
size=320x240

setup_more() {
    # Different along each axis, so that a picture that is turned or mirrored shows.
    /usr/bin/python3 -c "
v = bytearray(24 * 18 * 30)
for z in range(4, 20):
    for y in range(5, 13):
        for x in range(3, 16): v[(z * 18 + y) * 24 + x] = 60 + 8 * x
open('$volume', 'wb').write(v)"
}

# on_terminal COMMAND: runs it with a terminal as standard output; what it says goes to the file log.
# The shell is the same for everybody: script takes SHELL.
on_terminal() { SHELL=/bin/sh script -qec "$1" /dev/null </dev/null >log 2>&1 3>&-; }

# with_display: starts a display of our own, or skips with the reason.
with_display() {
    command -v script >/dev/null || skip 'script is not installed'
    starts_display vkt render --window "$volume"
}

# opens OPTION…: starts the viewer and waits for the full picture.
opens() {
    on_terminal "vkt render $volume --size $size $*" &
    command=$!
    finds_window
    titled ' [0-9]+ ms'
}

# titled PATTERN: the picture is full (no size in the title) and the title ends like this.
titled() {
    local title
    for _ in {1..150}; do
        title=$(xdotool getwindowname "$window")
        if [[ "$title" =~ $1$ && "$title" != *' at '* ]]; then return 0; fi
        sleep 0.1
    done
    echo "the title is '$title', not '$1'" >&2
    return 1
}

saves() {
    xdotool key s
    titled "saved $1"
    [ -s "$1" ]
}

quits() {
    xdotool key q
    wait "$command"
    command=
}

pixels_of() { /usr/bin/python3 -c "
import re, sys
sys.stdout.buffer.write(re.search(rb'IDAT.*', open(sys.argv[1], 'rb').read(), re.S).group())" "$1"; }

recipe_of() { /usr/bin/python3 -c "
import re, sys
print(re.search(rb'iTXtHistory\0+([^\0]*?)....iTXt', open(sys.argv[1], 'rb').read(), re.S).group(1)[:-4].decode())" "$1"; }

@test "the untouched window saves what -o writes, byte for byte" {
    with_display
    opens
    saves block_24x18x30_uint8.png
    # A name in use is left alone.
    saves block_24x18x30_uint8-2.png
    quits
    vkt render $volume --size 320x240 -o expected.png
    cmp block_24x18x30_uint8.png expected.png
    cmp block_24x18x30_uint8-2.png expected.png
}

@test "the window shows the picture, the right way up" {
    python_with vtk numpy
    with_display
    opens
    vkt render $volume --size 320x240 -o expected.png
    eval "$(xdotool getwindowgeometry --shell "$window")"
    sleep 0.3
    /usr/bin/python3 - "$X" "$Y" <<'PY'
import struct, sys, numpy, vtk
from vtk.util.numpy_support import vtk_to_numpy
raw = open('screen/Xvfb_screen0', 'rb').read() # XWD: big-endian words, then colours, then rows of BGRX
h = struct.unpack('>25I', raw[:100])
pixels = numpy.frombuffer(raw, numpy.uint8, h[5] * h[12], h[0] + 12 * h[19]).reshape(h[5], h[12] // 4, 4)
x, y = int(sys.argv[1]), int(sys.argv[2])
seen = pixels[y:y + 240, x:x + 320, 2::-1].astype(int)
r = vtk.vtkPNGReader(); r.SetFileName('expected.png'); r.Update()
wanted = vtk_to_numpy(r.GetOutput().GetPointData().GetScalars()).reshape(240, 320, 3)[::-1].astype(int)
worst = abs(seen - wanted).max()
print('largest difference', worst)
assert wanted.max() > 60 and worst <= 1
PY
    quits
}

@test "mouse and keys change the view, and the recipe of the picture makes it again" {
    with_display
    opens
    xdotool mousemove --window "$window" 160 120 mousedown 1
    for _ in {1..8}; do xdotool mousemove_relative 6 3; done
    xdotool mouseup 1 mousedown 3 mousemove_relative 20 10 mouseup 3 click 4 click 4 key c
    titled 'grey, [0-9]+ ms'
    saves block_24x18x30_uint8.png
    xdotool keydown shift mousedown 1
    for _ in {1..4}; do xdotool mousemove_relative 5 3; done
    xdotool mouseup 1 keyup shift
    sleep 0.5 # the title of the view before is of the same form
    titled ' ms'
    saves block_24x18x30_uint8-2.png
    # Reset leaves the colours.
    xdotool key r
    titled ' ms'
    saves block_24x18x30_uint8-3.png
    xdotool windowsize --sync "$window" 200 220
    titled ' ms.*'
    sleep 0.5
    saves block_24x18x30_uint8-4.png
    quits
    for n in '' -2 -3 -4; do
        recipe=$(recipe_of block_24x18x30_uint8$n.png)
        echo "$recipe"
        eval "$recipe -o again$n.png"
        cmp <(pixels_of block_24x18x30_uint8$n.png) <(pixels_of again$n.png)
    done
    [[ "$(recipe_of block_24x18x30_uint8.png)" == *--eye*--target*--up* ]]
    [ "$(recipe_of block_24x18x30_uint8-4.png)" != "${recipe/--size 200x220/}" ]
    vkt render $volume --size 320x240 --colormap grey -o home.png
    cmp <(pixels_of block_24x18x30_uint8-3.png) <(pixels_of home.png)
    run ! cmp -s <(pixels_of block_24x18x30_uint8.png) <(pixels_of block_24x18x30_uint8-2.png)
    run ! cmp -s <(pixels_of block_24x18x30_uint8.png) <(pixels_of home.png)
}

@test "an orthographic view has a recipe too" {
    with_display
    opens --projection orthographic
    xdotool mousemove --window "$window" 160 120 mousedown 1 mousemove_relative 40 30 mouseup 1 click 5
    titled ' ms'
    sleep 0.5
    saves block_24x18x30_uint8.png
    quits
    recipe=$(recipe_of block_24x18x30_uint8.png)
    [[ "$recipe" == *--span* ]]
    eval "$recipe -o again.png"
    cmp <(pixels_of block_24x18x30_uint8.png) <(pixels_of again.png)
}

@test "several volumes from a pipe are shown in turn" {
    with_display
    cp $volume two_24x18x30_uint8.raw
    on_terminal "bash -c 'cat <(vkt read $volume) <(vkt flip x two_24x18x30_uint8.raw) | vkt render --size 64'" &
    command=$!
    finds_window
    titled ' ms'
    saves volume.png
    xdotool key n
    titled ', volume 2.* ms'
    saves volume-2.png
    xdotool key n
    titled 'this is the last volume'
    quits
    run ! cmp -s <(pixels_of volume.png) <(pixels_of volume-2.png)
}

@test "closing the window while it draws loses nothing and does not wait" {
    with_display
    on_terminal "vkt render $volume --size 1000 -ra multi-scattering --spp 100000" &
    command=$!
    finds_window ' ms at '
    SECONDS=0
    quits
    [ "$SECONDS" -le 5 ]
}

# command_of: what p has printed last, as the shell reads it.
command_of() { tr -d '\r' <log | sed -n 's/^vkt render: \(vkt .*\)$/\1/p' | tail -n 1; }

# screenshot X Y WIDTH HEIGHT FILE: what the screen shows there, relative to the window, as a binary PPM.
screenshot() {
    eval "$(xdotool getwindowgeometry --shell "$window")"
    sleep 0.4
    /usr/bin/python3 - "$((X + $1))" "$((Y + $2))" "$3" "$4" "$5" <<'PY'
import struct, sys
raw = open('screen/Xvfb_screen0', 'rb').read() # XWD: big-endian words, then colours, then rows of BGRX
h = struct.unpack('>25I', raw[:100])
start, stride = h[0] + 12 * h[19], h[12]
x, y, w, t = (int(a) for a in sys.argv[1:5])
rows = b''
for j in range(y, y + t):
    row = raw[start + j * stride + 4 * x:start + j * stride + 4 * (x + w)]
    rows += b''.join(row[4 * i + 2:4 * i + 3] + row[4 * i + 1:4 * i + 2] + row[4 * i:4 * i + 1] for i in range(w))
open(sys.argv[5], 'wb').write(b'P6 %d %d 255\n' % (w, t) + rows)
PY
}

# shows_picture PNG WIDTH HEIGHT: the screen has the picture, pixel for pixel, at the window's upper left.
shows_picture() {
    xdotool mousemove 790 690 # the pointer is on the screen, too
    screenshot 0 0 "$2" "$3" seen.ppm
    /usr/bin/python3 - "$1" <<'PY'
import sys, numpy, vtk
from vtk.util.numpy_support import vtk_to_numpy
def levels(reader, name):
    reader.SetFileName(name); reader.Update()
    d = reader.GetOutput().GetDimensions()
    return vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(d[1], d[0], 3).astype(int)
seen, wanted = levels(vtk.vtkPNMReader(), 'seen.ppm'), levels(vtk.vtkPNGReader(), sys.argv[1])
worst = abs(seen - wanted).max()
print('largest difference', worst)
assert wanted.max() > 60 and worst <= 1
PY
}

# presses KEY: the keyboard of the window.
presses() { xdotool key "$1"; sleep 0.3; }

@test "p prints the command that draws what is on the screen" {
    python_with vtk numpy
    with_display
    opens
    xdotool mousemove --window "$window" 160 120 mousedown 1
    for _ in {1..6}; do xdotool mousemove_relative 7 4; done
    xdotool mouseup 1
    presses bracketright
    sleep 0.5
    titled ' ms'
    presses p
    titled 'the command is in the terminal'
    said=$(command_of)
    echo "$said"
    [[ "$said" == *--eye*--step*' -o block_24x18x30_uint8.png' ]]
    eval "$said"
    shows_picture block_24x18x30_uint8.png 320 240
    # Surfaces, and what is scattered, too. A name that is taken is not said again.
    presses i
    titled 'implicit-iso, automatic colours, [0-9]+ ms.*'
    presses p
    sleep 0.5
    said=$(command_of)
    [[ "$said" == *implicit-iso*' -o block_24x18x30_uint8-2.png' && "$said" != *--step* ]]
    eval "$said"
    shows_picture block_24x18x30_uint8-2.png 320 240
    quits
}

@test "knots in the editor change the picture; undo and redo" {
    python_with vtk numpy
    with_display
    opens
    vkt render $volume --size 320x240 -o before.png
    shows_picture before.png 320 240
    # A click above the histogram makes a knot.
    xdotool mousemove --window "$window" 520 60
    sleep 0.3
    xdotool click 1
    titled 'edited colours, [0-9]+ ms'
    presses p
    sleep 0.5
    said=$(command_of)
    echo "$said"
    [[ "$said" == *--colormap\ tissue\ --opacity*--domain* ]]
    eval "$said"
    shows_picture block_24x18x30_uint8.png 320 240
    run ! cmp -s <(pixels_of before.png) <(pixels_of block_24x18x30_uint8.png)
    xdotool mousemove --window "$window" 100 100
    presses ctrl+z
    titled 'automatic colours, [0-9]+ ms.*'
    shows_picture before.png 320 240
    presses ctrl+y
    titled 'edited colours, [0-9]+ ms.*'
    shows_picture block_24x18x30_uint8.png 320 240
    quits
}

# clicks X Y: a click into the window, as slow as a hand.
clicks() {
    xdotool mousemove --window "$window" "$1" "$2"
    sleep 0.3
    xdotool click 1
    sleep 0.3
}

@test "light, its shadows, occlusion and a clip plane from the panels are in the picture and in the command" {
    python_with vtk numpy
    with_display
    opens
    vkt render $volume --size 320x240 -o before.png
    clicks 480 18 # closes the transfer function
    clicks 480 43 # and the integrator
    clicks 480 68 # opens the light
    clicks 338 168 # ambient occlusion
    clicks 420 218 # its radius
    clicks 338 93 # a light from a direction
    clicks 338 168 # its shadows
    clicks 480 68 # closes the light
    clicks 480 93 # and the picture
    clicks 480 168 # opens the clip planes
    clicks 360 193 # adds one
    titled ' ms'
    presses p
    sleep 0.5
    said=$(command_of)
    echo "$said"
    [[ "$said" == *--light-direction*--shadows*--ambient-occlusion\ 16*--occlusion-radius\ *--clip-plane* ]]
    eval "$said"
    shows_picture block_24x18x30_uint8.png 320 240
    run ! cmp -s <(pixels_of before.png) <(pixels_of block_24x18x30_uint8.png)
    quits
}

@test "labels are shown as they are written, and other colours are a wish for these" {
    python_with vtk numpy
    with_display
    opens --labels always
    vkt render $volume --size 320x240 --labels always -o expected.png
    shows_picture expected.png 320 240
    # Slices have the colours that a picture without light has.
    vkt render $volume --size 320x240 --labels always --shade none -o flat.png
    presses l
    sleep 0.5
    screenshot 0 0 320 240 slices.ppm
    /usr/bin/python3 - <<'PY'
import numpy, vtk
from vtk.util.numpy_support import vtk_to_numpy
def colours(reader, name):
    reader.SetFileName(name); reader.Update()
    rgb = vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(-1, 3).astype(int)
    return rgb @ [65536, 256, 1]
flat, count = numpy.unique(colours(vtk.vtkPNGReader(), 'flat.png'), return_counts=True)
labels = [c for c, n in zip(flat, count) if n > 50 and c != flat[count.argmax()]]
lit, slices = (numpy.isin(colours(vtk.vtkPNMReader(), name), labels).sum() for name in ('seen.ppm', 'slices.ppm'))
print(len(labels), 'labels,', lit, 'pixels of the picture and', slices, 'of the slices in their colours')
assert len(labels) > 5 and slices > lit + 200
PY
    presses l
    presses c
    titled ' [0-9]+ ms'
    presses p
    sleep 0.5
    said=$(command_of)
    echo "$said"
    [[ "$said" == *--colormap* && "$said" != *--labels* ]]
    eval "$said"
    shows_picture block_24x18x30_uint8.png 320 240
    quits
}

@test "an environment is shown, and turned by the command that is printed" {
    python_with vtk numpy
    with_display
    /usr/bin/python3 -c "
import numpy as np
sky = np.full((8, 16, 3), 0.2, '<f4')
sky[2, 4] = 30
open('sky.pfm', 'wb').write(b'PF\n16 8\n-1.0\n' + sky.tobytes())"
    opens -ra multi-scattering --spp 8 --environment sky.pfm
    vkt render $volume --size 320x240 -ra multi-scattering --spp 8 --environment sky.pfm -o expected.png
    shows_picture expected.png 320 240
    presses p
    sleep 0.5
    [[ "$(command_of)" == *'--environment sky.pfm'* ]]
    quits
}

@test "paths add up on the screen to the picture of all of them" {
    python_with vtk numpy
    with_display
    opens -ra multi-scattering --spp 6
    vkt render $volume --size 320x240 -ra multi-scattering --spp 6 -o expected.png
    shows_picture expected.png 320 240
    saves block_24x18x30_uint8.png
    cmp <(pixels_of block_24x18x30_uint8.png) <(pixels_of expected.png)
    quits
}

# magnifies Y STEP: a part of the block in a box from there on, each step of the hand so many pixels down, shown finer.
magnifies() {
    presses b
    xdotool mousemove --window "$window" 130 "$1" mousedown 1
    for _ in {1..6}; do xdotool mousemove_relative 10 "$2"; done
    xdotool mouseup 1
    sleep 0.3
    presses Return
    for _ in {1..100}; do
        [[ "$(xdotool getwindowname "$window")" != *'(24 18 30)'* ]] && break
        sleep 0.1
    done
}

@test "a part in a box is resampled finer, and its command makes the same picture" {
    with_display
    opens
    magnifies 90 8
    titled ' ms'
    saves block_24x18x30_uint8.png
    presses p
    sleep 0.5
    said=$(command_of)
    echo "$said"
    [[ "$said" == *crop*--roi*resample*--scale*render* ]]
    eval "$said"
    cmp <(pixels_of block_24x18x30_uint8.png) <(pixels_of block_24x18x30_uint8-2.png)
    presses BackSpace
    titled '.24.* ms'
    presses s
    titled 'saved block_24x18x30_uint8-3.png'
    vkt render $volume --size 320x240 -o whole.png
    cmp <(pixels_of block_24x18x30_uint8-3.png) <(pixels_of whole.png)
    quits
}

@test "a volume that comes slowly is shown while it comes" {
    with_display
    vkt make noise --dims 64 64 64 --dtype uint8 -o noise.nrrd
    cat >slow.py <<'PY'
import sys, time
data = sys.stdin.buffer.read()
for i in range(8):
    sys.stdout.buffer.write(data[i * len(data) // 8:(i + 1) * len(data) // 8])
    sys.stdout.buffer.flush()
    time.sleep(0.5)
PY
    on_terminal "bash -c 'vkt read noise.nrrd --transport pipe | /usr/bin/python3 slow.py | vkt render --size 64'" &
    command=$!
    finds_window ' at [0-9]+ of 64 slices'
    titled ' ms'
    saves volume.png
    quits
    vkt render noise.nrrd --size 64 -o expected.png
    cmp <(pixels_of volume.png) <(pixels_of expected.png)
}

@test "a small volume that comes slowly is shown while it comes, too" {
    with_display
    vkt make noise --dims 64 64 64 --dtype uint8 -o noise.nrrd
    cat >slow.py <<'PY'
import sys, time
while data := sys.stdin.buffer.read(65536):
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()
    time.sleep(0.7)
PY
    on_terminal "bash -c 'vkt read noise.nrrd --transport pipe --slab 4 | /usr/bin/python3 slow.py | vkt render --size 64'" &
    command=$!
    finds_window ' at [1-9][0-9]* of 64 slices'
    titled ' ms'
    quits
}

@test "of a volume that ends early what came stays, and the exit code tells of it once the window is closed" {
    with_display
    vkt make noise --dims 64 64 64 --dtype uint8 -o noise.nrrd
    vkt read noise.nrrd --transport pipe --slab 4 >whole.vkt
    head -c 160000 whole.vkt >cut.vkt
    for input in '<cut.vkt vkt render' 'vkt fill cut.vkt --value 9 --roi 0:1,0:1,0:1 | vkt render'; do
        printf '%s\n' "$input --size 64 --window" 'echo "code $?"' >show.sh
        on_terminal "bash show.sh" &
        command=$!
        finds_window ' at [1-9][0-9]* of 64 slices.*ended early'
        xdotool mousemove --window "$window" 32 32 mousedown 1 mousemove_relative 10 6 mouseup 1
        sleep 0.5
        xdotool key s
        finds_window 'nothing is saved: the volume is not whole'
        quits
        cat log
        grep -q 'code 3' log
        [ "$(grep -c 'ended early' log)" -eq 1 ]
        [ -z "$(ls ./*.png 2>/dev/null)" ]
    done
    # The next one cannot be had, but this one can still be seen.
    cat whole.vkt cut.vkt >second.vkt
    printf '%s\n' '<second.vkt vkt render --size 64 --window' 'echo "code $?"' >show.sh
    on_terminal "bash show.sh" &
    command=$!
    finds_window
    titled ' ms'
    xdotool key n
    finds_window ' at [1-9][0-9]* of 64 slices.*ended early'
    xdotool key n
    finds_window 'this is the last volume'
    quits
    grep -q 'code 3' log
}

@test "a click and a drag, or two drags, are no double click" {
    with_display
    opens
    camera() { xdotool key p; sleep 0.4; command_of | grep -o -- '--target [^ ]*' || true; }
    xdotool mousemove --window "$window" 160 120 mousedown 1 mousemove_relative 20 0 mouseup 1
    turned=$(camera)
    [ -n "$turned" ]
    xdotool click 1 mousedown 1 mousemove_relative 40 0 mouseup 1
    sleep 0.4
    xdotool mousedown 1 mousemove_relative -- -40 0 mouseup 1 mousedown 1 mousemove_relative -- -30 10 mouseup 1
    again=$(camera)
    echo "$turned, then $again"
    [ "$again" = "$turned" ]
    sleep 0.4
    xdotool mousemove --window "$window" 170 125 click --repeat 2 --delay 40 1
    picked=$(camera)
    [ -n "$picked" ]
    [ "$picked" != "$turned" ]
    quits
}

@test "surfaces of values beyond those of single precision have sliders, too" {
    with_display
    /usr/bin/python3 -c "
import struct
open('huge_8x8x8_float64.raw', 'wb').write(struct.pack('<512d', *((x % 8 - 4) * 1e300 for x in range(512))))"
    volume=huge_8x8x8_float64.raw
    size=320x640
    opens
    presses i
    titled 'implicit-iso, automatic colours, [0-9]+ ms'
    presses p
    titled 'the command is in the terminal'
    quits
}

@test "hierarchical volumes have surfaces and scatter light at a key, too" {
    with_display
    vkt make noise --dims 32 32 32 --dtype uint8 -o noise.nrrd
    on_terminal "bash -c 'vkt refine noise.nrrd --tolerance 40 | vkt render --size 64'" &
    command=$!
    finds_window
    titled ' ms'
    presses i
    titled 'implicit-iso, automatic colours, [0-9]+ ms'
    presses t
    titled 'multi-scattering, automatic colours, [0-9]+ ms'
    quits
}

@test "the help is not cut off over a narrow picture" {
    python_with numpy
    with_display
    opens
    presses h
    screenshot 0 0 320 240 help.ppm
    # Between the longest line that there is room for and the scroll bar there is nothing.
    /usr/bin/python3 -c "
import numpy as np
seen = np.frombuffer(open('help.ppm', 'rb').read()[-320 * 240 * 3:], np.uint8).reshape(240, 320, 3).astype(int)
text = seen[42:230, 20:287].max(axis=2) > 120
margin = seen[42:230, 288:300].max(axis=2) > 120
print(text.sum(), 'pixels of text and', margin.sum(), 'in the margin')
assert text.sum() > 2000 and margin.sum() == 0"
    presses h
    quits
}

@test "Escape closes what is open before it closes the window" {
    with_display
    size=320x320
    opens
    # A double click in the strip of colours makes one and asks which.
    xdotool mousemove --window "$window" 520 188
    sleep 0.3
    xdotool click --repeat 2 --delay 60 1
    titled 'edited colours, [0-9]+ ms'
    screenshot 320 0 300 320 open.ppm
    presses Escape
    screenshot 320 0 300 320 closed.ppm
    run ! cmp -s open.ppm closed.ppm
    for shown in h b; do
        presses $shown
        presses Escape
    done
    titled 'edited colours, [0-9]+ ms'
    xdotool key Escape
    wait "$command"
    command=
}

# drags_clip: the upper end of x in the panel of the clip box, which is the only open one.
drags_clip() {
    xdotool mousemove --window "$window" 470 168 mousedown 1
    for _ in {1..6}; do
        xdotool mousemove_relative -- -5 0
        sleep 0.05
    done
    xdotool mouseup 1
    sleep 0.5
}

# clip_said: the box of the command that p prints.
clip_said() {
    presses p
    sleep 0.5
    command_of | grep -o -e '--clip-box [^ ]*'
}

@test "a clip box is one of the volume that is shown, whole or in part" {
    with_display
    size=320x400
    opens
    clicks 480 18 # closes the transfer function
    clicks 480 43 # and the integrator
    clicks 480 93 # and the picture
    clicks 480 143 # opens the clip box
    drags_clip
    of_whole=$(clip_said)
    echo "$of_whole"
    magnifies 150 10
    # Undo brings no voxels of the whole into the part.
    presses ctrl+z
    titled '[0-9]+ ms'
    run ! clip_said
    drags_clip
    [ "$(clip_said)" != "$of_whole" ]
    presses BackSpace
    titled '.24 18 30.* [0-9]+ ms'
    [ "$(clip_said)" = "$of_whole" ]
    quits
}

@test "the command of one of several volumes draws them all, and names are quoted" {
    with_display
    for n in 1 2; do vkt make noise --dims 16 16 16 --dtype uint8 --seed $n --no-history -o "step $n.nrrd"; done
    volume="'step *.nrrd'"
    opens
    for n in 0 1; do
        presses p
        titled 'the command is in the terminal'
        said=$(command_of)
        echo "$said"
        eval "$said"
        presses s
        titled 'saved .*'
        saved=$(xdotool getwindowname "$window")
        saved=${saved##*saved }
        drawn=(step*-000$n.png)
        cmp <(pixels_of "$saved") <(pixels_of "${drawn[0]}")
        rm step*.png
        presses n
        sleep 0.5
    done
    quits
}

@test "the command that vkt view prints makes a picture" {
    with_display
    on_terminal "vkt view $volume --size 64" &
    command=$!
    finds_window
    titled ' ms'
    presses p
    titled 'the command is in the terminal'
    said=$(tr -d '\r' <log | sed -n 's/^vkt view: \(vkt .*\)$/\1/p')
    echo "$said"
    eval "$said"
    vkt render $volume --size 64 -o expected.png
    cmp block_24x18x30_uint8.png expected.png
    quits
}

@test "the command names the file that is open, not what once made it" {
    with_display
    vkt make noise --dims 16 16 16 --dtype uint8 | vkt filter gaussian --sigma 1 -o made.vkt
    volume=made.vkt
    opens
    presses p
    titled 'the command is in the terminal'
    said=$(command_of)
    echo "$said"
    [[ "$said" == 'vkt render made.vkt '*' -o made.png' ]]
    # A part of it is cut out of the file.
    magnifies 90 8
    titled ' ms'
    presses p
    sleep 0.5
    said=$(command_of)
    echo "$said"
    [[ "$said" == 'vkt read made.vkt | vkt crop '*' | vkt resample '*' | vkt render '*' -o made.png' ]]
    quits
    # What comes through a pipe has no name.
    volume='- <made.vkt'
    opens
    presses p
    titled 'the command is in the terminal'
    said=$(command_of)
    echo "$said"
    [[ "$said" == 'vkt make noise '*' | vkt render '* ]]
    quits
}

@test "of several volumes the title says which one is shown, and all have the colours of the first" {
    with_display
    for n in 1 2 3; do
        vkt make sphere --dims 16 16 16 --dtype uint8 --inside ${n}0 --no-history -o "step$n.nrrd"
    done
    volume="'step*.nrrd'"
    opens
    presses n
    titled ', volume 2.* ms'
    presses n
    titled ', volume 3.* ms'
    presses s
    titled 'saved .*'
    saved=$(xdotool getwindowname "$window")
    saved=${saved##*saved }
    vkt render 'step*.nrrd' --size 320x240 -o of-%d.png
    cmp <(pixels_of "$saved") <(pixels_of of-2.png)
    presses n
    titled 'this is the last volume'
    presses comma
    titled ', volume 2 of 3.* ms'
    quits
}

@test "--window opens one where standard output is no terminal" {
    with_display
    vkt render $volume --size 64 --window >out 2>log 3>&- &
    command=$!
    finds_window
    quits
    [ ! -s out ]
    fails_with 2 'exclude each other' vkt render $volume --window -o a.png
    unset DISPLAY
    fails_with 2 'no window: ' vkt render $volume --window
}

@test "without a display one line says what to do" {
    command -v script >/dev/null || skip "script is not installed"
    unset DISPLAY WAYLAND_DISPLAY
    code=0
    on_terminal "vkt render $volume" || code=$?
    [ "$code" -eq 2 ]
    grep -q 'no window: .*' log
    grep -q -e '-o FILE' log
    # A redirected picture needs no window, with or without a display.
    vkt render $volume --size 16 >a.png
    vkt render $volume --size 16 -o b.png
    cmp a.png b.png
}

@test "a display that does not answer is said" {
    command -v script >/dev/null || skip "script is not installed"
    unset WAYLAND_DISPLAY
    code=0
    DISPLAY=:9753 on_terminal "vkt render $volume" || code=$?
    ! grep -q 'without the viewer' log || skip 'this vkt was built without the viewer'
    [ "$code" -eq 5 ]
    grep -q 'no window: ' log
    grep -q -e '-o FILE' log
}

# shown N: so many different pictures are seen in the window within a few seconds.
shown() {
    rm -f seen
    for _ in {1..100}; do
        screenshot 20 20 200 150 now.ppm
        sha256sum <now.ppm >>seen
        [ "$(sort -u seen | wc -l)" -lt "$1" ] || return 0
        sleep 0.1
    done
    echo "$(sort -u seen | wc -l) pictures" >&2
    return 1
}

@test "a comma goes back to the volume before; what a pipe has brought does not come again" {
    with_display
    for n in 1 2 3; do vkt make noise --dims 16 16 16 --dtype uint8 --seed $n --no-history -o "step$n.nrrd"; done
    volume="'step*.nrrd'"
    opens
    screenshot 20 20 200 150 first.ppm
    presses comma
    titled 'no volume before that can be had once more'
    presses n
    titled ' ms'
    screenshot 20 20 200 150 second.ppm
    presses n
    titled ' ms'
    presses comma
    titled ' ms'
    screenshot 20 20 200 150 now.ppm
    cmp now.ppm second.ppm
    presses comma
    titled ' ms'
    screenshot 20 20 200 150 now.ppm
    cmp now.ppm first.ppm
    run ! cmp -s first.ppm second.ppm
    # It goes on from there.
    presses n
    titled ' ms'
    screenshot 20 20 200 150 now.ppm
    cmp now.ppm second.ppm
    quits
    mkfifo steps
    vkt read 'step*.nrrd' --transport pipe >steps 3>&- &
    volume='- <steps'
    opens
    presses n
    titled ' ms'
    presses comma
    titled 'no volume before that can be had once more'
    quits
}

@test "k shows what is greatest, least and the mean along rays, as the command that it prints does" {
    with_display
    opens --light-direction 1,1,1 --opacity-scale 2
    for algorithm in maximum minimum mean maximum; do
        presses k
        titled "$algorithm, .* ms"
        presses p
        titled 'the command is in the terminal'
        said=$(command_of)
        echo "$said"
        [[ "$said" == *"--render-algo $algorithm"* ]]
        eval "$said"
        presses s
        titled 'saved .*'
        saved=$(xdotool getwindowname "$window")
        saved=${saved##*saved }
        drawn=$(ls -t ./*.png | grep -v "^./$saved\$" | head -n 1)
        cmp <(pixels_of "$saved") <(pixels_of "$drawn")
        rm ./*.png
    done
    presses m
    titled 'ray-marching, .* ms'
    quits
}

@test "volumes are played again and again until they are stopped, those of a pipe once" {
    with_display
    for n in 1 2 3; do vkt make noise --dims 16 16 16 --dtype uint8 --seed $n --no-history -o "step$n.nrrd"; done
    volume="'step*.nrrd'"
    opens
    presses period
    shown 3
    shown 3 # the first one has come again
    [[ "$(xdotool getwindowname "$window")" == *' - playing' ]]
    presses period
    titled ' ms'
    quits
    mkfifo steps
    vkt read 'step*.nrrd' --transport pipe >steps 3>&- &
    volume='- <steps'
    opens
    presses period
    titled ' ms - this is the last volume'
    presses period # there is no first one to come back to
    titled ' ms - this is the last volume'
    quits
    # One volume is the first and the last.
    volume=step1.nrrd
    opens
    presses period
    titled ' ms - this is the last volume'
    quits
}

# colours_in FILE: the pixels of a screenshot, as the python variable seen (rows, columns, red to blue).
colours_in() {
    echo "import numpy as np
raw = open('$1', 'rb').read()
w, h = map(int, raw.split(b' ', 3)[1:3])
seen = np.frombuffer(raw[-w * h * 3:], np.uint8).reshape(h, w, 3).astype(int)"
}

@test "what is greatest along rays is shown in its own colours in the panels, too" {
    python_with numpy
    with_display
    opens
    # The strip of colours between its ends.
    screenshot 336 184 284 7 march.ppm
    presses k
    titled 'maximum, .* ms'
    screenshot 336 184 284 7 greatest.ppm
    /usr/bin/python3 -c "$(colours_in greatest.ppm)
assert seen[:, :, 0].max() > 240 and (np.ptp(seen, axis=2) == 0).all()
$(colours_in march.ppm)
assert np.ptp(seen, axis=2).max() > 50"
    # No knot where there are no opacities.
    clicks 520 60
    titled 'maximum, automatic colours, .* ms'
    quits
}

@test "a number that is typed faster than frames are drawn is taken" {
    with_display
    size=320x320
    opens
    for upper in 91 92.5 93; do
        xdotool mousemove --window "$window" 460 244
        sleep 0.3
        read -ra digits <<<"$(sed 's/\./period/; s/[0-9]/& /g; s/period/period /' <<<"$upper")"
        xdotool click 1 key --delay 0 ctrl+a "${digits[@]}" Return
        titled 'edited colours, [0-9]+ ms.*'
        sleep 0.5
        presses p
        titled 'the command is in the terminal'
        said=$(command_of)
        echo "$said"
        [[ "$said" == *"--domain "*":$upper "* ]]
    done
    # Lower than the lower end it cannot be.
    xdotool mousemove --window "$window" 460 244
    sleep 0.3
    xdotool click 1 key --delay 0 ctrl+a minus 5 Return
    titled 'the domain stays: .* is not below -5'
    quits
}

@test "narrow windows are all picture, and slices follow the window's size" {
    python_with numpy
    with_display
    opens
    xdotool windowsize --sync "$window" 400 300
    titled ' [0-9]+ ms'
    sleep 0.5
    saves block_24x18x30_uint8.png
    [ "$(/usr/bin/python3 -c "
import struct
print(*struct.unpack('>II', open('block_24x18x30_uint8.png', 'rb').read()[16:24]))")" = '400 300' ]
    presses g
    titled 'the window is too narrow for panels'
    presses l
    # How far the frames of the slices, red and blue, reach.
    frames="blue = (seen == [85, 145, 250]).all(axis=2).any(axis=0).nonzero()[0]
red = (seen == [235, 85, 75]).all(axis=2).any(axis=0).nonzero()[0]
print(red.min(), blue.max())"
    screenshot 0 0 400 300 small.ppm
    xdotool windowsize --sync "$window" 780 680
    sleep 1
    screenshot 0 0 450 680 large.ppm
    xdotool windowsize --sync "$window" 400 300
    sleep 1
    screenshot 0 0 400 300 again.ppm
    /usr/bin/python3 -c "$(colours_in small.ppm)
$frames
assert red.min() < 60 and 340 < blue.max() < 400
$(colours_in large.ppm)
$frames
assert red.min() < 60 and 380 < blue.max() < 450
$(colours_in again.ppm)
$frames
assert red.min() < 60 and 340 < blue.max() < 400"
    # The help is read there, too: it has the window.
    presses h
    screenshot 0 0 400 300 help.ppm
    /usr/bin/python3 -c "$(colours_in help.ppm)
text = seen.max(axis=2) > 120
print(text.sum(), 'pixels of text')
assert text[40:, 130:].sum() > 2000 and not (seen == [85, 145, 250]).all(axis=2).any()"
    quits
}

@test "slices leave scale bar and axes free" {
    python_with numpy
    with_display
    opens
    presses l
    presses v
    for size in '512 512' '780 500'; do
        read -r width height <<<"$size"
        xdotool windowsize --sync "$window" "$width" "$height"
        titled ' [0-9]+ ms'
        xdotool mousemove 790 690
        sleep 0.5
        picture=$((width < 580 ? width : width - 330))
        screenshot 0 0 $picture "$height" seen.ppm
        /usr/bin/python3 -c "$(colours_in seen.ppm)
bar = (seen[h - 16] == 255).all(axis=1)
axes = seen[h - 100:, w - 100:]
blue = (axes == [85, 145, 250]).all(axis=2).sum()
print(bar.sum(), 'points of the scale bar,', blue, 'of an axis')
assert bar.sum() > 20 and blue > 30"
    done
    quits
}

@test "slices of a volume of one value are mid grey" {
    python_with numpy
    with_display
    /usr/bin/python3 -c "open('flat_8x8x8_uint8.raw', 'wb').write(bytes([7]) * 512)"
    volume=flat_8x8x8_uint8.raw
    opens
    presses l
    screenshot 0 0 320 240 flat.ppm
    /usr/bin/python3 -c "$(colours_in flat.ppm)
grey = (abs(seen - 127) <= 1).all(axis=2).sum()
print(grey, 'pixels of mid grey')
assert grey > 5000"
    quits
}
