# Command lines of volkit's README and manual, unchanged.
load helper

setup_more() { vkt make sphere --dims 24 20 16 --dtype uint8 | vkt write v_24x20x16_uint8.raw; FILE=v_24x20x16_uint8.raw; }
is_png() { [ "$(head -c 8 "$1" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]; }

@test "resample to another type and size, and render" {
    vkt read -i $FILE | vkt resample --data-format uint16 -dims 16 16 16 | vkt render >out.png
    is_png out.png
}

@test "declare, fill, render" {
    vkt declare-sv --dims 32 32 32 --data-format uint8 | vkt fill --value 1 | vkt render >out.png
    is_png out.png
}

@test "declare, fill, fill a range, render" {
    vkt declare-sv --dims 32 32 32 --data-format uint8 | vkt fill --value 0.05 | vkt fill-range --value 1 --first 0 0 0 --last 8 8 8 | vkt render >out.png
    is_png out.png
    vkt declare-sv --dims 32 32 32 --data-format uint8 | vkt fill --value 0.05 | vkt fill-range --value 1 --first 0 0 0 --last 8 8 8 | vkt stats --json >s
    grep -q '"max": 1,' s
    grep -q '"argmax": \[0, 0, 0\]' s
}

@test "render with volkit's algorithm and lookup table" {
    vkt read -i $FILE | vkt render --render-algo multi-scattering --size 96 --rgba-lookup-table 1 1 1 0  0.2 0.0 0.2 0.2  0.0 0.8 0.8 0.8  1 1 0 1 >out.png
    is_png out.png
}

@test "dump, set-header, write" {
    vkt read -i $FILE | vkt set-header --dist 1 1 2 | vkt dump-range --first 0 0 0 --last 2 2 2 | grep -q 'dist: (1.0,1.0,2.0)'
    vkt read -i $FILE | vkt write -o out_24x20x16_uint8.raw
    cmp $FILE out_24x20x16_uint8.raw
}
