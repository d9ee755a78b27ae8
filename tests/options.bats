# How words of the command line become values, whatever the command.
load helper

setup_more() { vkt make ramp --dims 4 4 4 -o v.nrrd; }

@test "an option of three values takes three words and leaves the file name" {
    for form in '--dims 8 8 8' '--dims 8,8,8' '--dims=8,8,8' '--dims=8 8 8' '-dims 8,8,8'; do
        # shellcheck disable=SC2086
        [ "$(vkt resample $form v.nrrd | vkt info --json | tr -d ' \n' | grep -o '"dims":[^]]*')" = '"dims":[8,8,8' ]
    done
    for form in '--dist 1 2 3' '--dist 1,2,3' '--dist=1,2,3'; do
        # shellcheck disable=SC2086
        vkt set $form v.nrrd | vkt info | grep -q 'spacing *1 2 3$'
    done
    vkt fill-range --value 1 --first 0 0 0 --last 2 2 2 v.nrrd -o a.nrrd
    vkt fill-range --value 1 v.nrrd --first 0 0 0 --last 2 2 2 | vkt diff - a.nrrd
    vkt make constant --dims 4 4 4 --dtype uint8 --value 3 -o c.nrrd
    vkt set --voxel-mapping -1 1 c.nrrd -o mapped.nrrd
    vkt set --voxel-mapping=-1,1 c.nrrd | vkt diff - mapped.nrrd
    fails_with 2 "not an integer" vkt resample --dims 8 8 v.nrrd
    fails_with 2 "too many" vkt resample --dims 8 8 8 --dims 8 8 8 v.nrrd
}

@test "a list of numbers ends at the first other word" {
    vkt render v.nrrd --size 16 --lut 1 0 0 0 0 1 0 1 -o a.png
    vkt render --size 16 --lut 1 0 0 0 0 1 0 1 v.nrrd -o b.png
    vkt render --size 16 --lut=1 0 0 0 0 1 0 1 v.nrrd -o c.png
    cmp a.png b.png
    cmp a.png c.png
    fails_with 2 "'abc' is not a number" vkt render --lut abc v.nrrd -o d.png
}

@test "a file where a number was left out is named as such, and how to say it" {
    fails_with 2 "--sigma needs a number, 'v.nrrd' is not one" vkt filter gaussian --sigma v.nrrd -o x.nrrd
    [[ "$stderr" == *"hint: its value was left out: --sigma S v.nrrd"* ]]
    fails_with 2 "--radius needs an integer, 'v.nrrd' is not one" vkt filter median --radius v.nrrd
    fails_with 2 "--dims needs three integers X Y Z, 'v.nrrd' is a file" vkt resample --dims v.nrrd
    fails_with 2 "--percentiles needs a number, 'v.nrrd' is not one" vkt stats --percentiles v.nrrd
    fails_with 2 "--range needs a range LO:HI, 'v.nrrd' is not one" vkt histogram --range v.nrrd
    fails_with 2 "--dtype needs a data type, 'v.nrrd' is not one" vkt convert --dtype v.nrrd
    fails_with 2 "--method needs one of auto, nearest" vkt rotate --method v.nrrd
    fails_with 2 "--roi needs a value REGION, 'v.nrrd' is not one" vkt crop --roi v.nrrd
    fails_with 2 "--memory needs a value SIZE, 'v.nrrd' is not one" vkt flip x v.nrrd --memory v.nrrd
    fails_with 2 "filter box: --radius needs an integer" vkt pipe 'read v.nrrd | filter box --radius v.nrrd | stats'
    # What names no file is told as ever.
    fails_with 2 "--sigma: 'w.nrrd' is not a number" vkt filter gaussian --sigma w.nrrd
}

@test "a value from an option or a variable is named with its whole word" {
    fails_with 2 "--memory: 'abc' is not a size" vkt stats v.nrrd --memory abc
    fails_with 2 "--memory: '1.2.3G' is not a size" vkt stats v.nrrd --memory 1.2.3G
    VKT_MEMORY=5Q fails_with 2 "VKT_MEMORY: '5Q' is not a size" vkt stats v.nrrd
    VKT_DEVICE=abc fails_with 2 "VKT_DEVICE: 'abc' is not one of" vkt stats v.nrrd
}

@test "options that do not apply to the output are refused" {
    fails_with 2 "--compress: streams are not compressed" vkt flip x v.nrrd --compress
    fails_with 2 "--compress: streams are not compressed" vkt flip x v.nrrd --compress -o o.vkt
    fails_with 2 "--no-checksum: only streams" vkt flip x v.nrrd --no-checksum -o o.nrrd
    fails_with 2 "--no-checksum: only streams" vkt flip x v.nrrd --no-checksum --format raw
    fails_with 2 "--transport: no other command" vkt flip x v.nrrd --transport shm -o o.vkt
    [ "$(vkt flip x v.nrrd --transport shm -o o.nrrd 2>&1 | wc -l)" = 1 ]
    [ ! -e o.nrrd ]
    [ ! -e o.vkt ]
    VKT_TRANSPORT=shm vkt flip x v.nrrd -o o.nrrd
    vkt flip x v.nrrd --no-checksum -o o.vkt
    vkt flip x v.nrrd --format vkt --no-checksum --transport pipe | vkt diff - o.vkt
    vkt flip x v.nrrd --compress -o p.nrrd
}

@test "--transport gpu is refused where there is no GPU, and downstream is told" {
    vkt doctor | grep -q '^GPUs  *none' || skip "there is a GPU: tests/gpu/transport.sh"
    fails_with 5 "vkt flip: --transport gpu: " vkt flip x v.nrrd --transport gpu
    VKT_TRANSPORT=gpu fails_with 5 "vkt flip: VKT_TRANSPORT=gpu: " vkt flip x v.nrrd
    fails_with 2 "'rail' is not one of" vkt flip x v.nrrd --transport rail
    fails_with 2 "--transport: no other command" vkt flip x v.nrrd --transport gpu -o o.nrrd
    run --separate-stderr bash -c 'vkt flip x v.nrrd --transport gpu | vkt write o.nrrd; echo ${PIPESTATUS[*]}'
    [ "$output" = '5 3' ]
    [ "$(grep -c '^vkt [^h]*: [^h]' <<<"$stderr")" -eq 1 ]
    [ ! -e o.nrrd ]
    # What leaves into a file takes no transport.
    VKT_TRANSPORT=gpu vkt flip x v.nrrd -o o.nrrd
    VKT_TRANSPORT=gpu vkt stats v.nrrd >/dev/null
}

@test "who asks for each volume is told that this is so" {
    fails_with 2 "every command treats each of several volumes by itself" vkt flip x v.nrrd --each
}

@test "flip takes its axis as an option, too" {
    vkt flip y v.nrrd -o y.nrrd
    for words in '--axis y v.nrrd' 'v.nrrd --axis y' '--axis=y v.nrrd' '-axis y v.nrrd'; do
        # shellcheck disable=SC2086
        vkt flip $words | vkt diff - y.nrrd
    done
    fails_with 2 "unexpected argument" vkt flip x v.nrrd --axis y
    fails_with 2 "missing AXIS" vkt flip --roi 0:2,:,: -o z.nrrd
}

@test "write -o OUT takes its argument as the input" {
    vkt write -o w.vkt v.nrrd
    vkt write v.nrrd --output w.nrrd
    vkt read v.nrrd | vkt write -o x.vkt
    for f in w.vkt w.nrrd x.vkt; do vkt diff $f v.nrrd; done
    fails_with 2 "two outputs: 'w.nrrd' and 'z.vkt'" vkt write -o z.vkt v.nrrd w.nrrd
    [ ! -e z.vkt ]
}

@test "-v says what was decided: formats, regions, transport, plan" {
    vkt crop v.nrrd --roi 25%:75%,:,1:+2 -v 2>log | vkt info >/dev/null
    grep -qx 'vkt crop: .*v.nrrd: format nrrd, 4 4 4 float32' log
    grep -qx 'vkt crop: region 1:3,0:4,1:3' log
    grep -qx 'vkt crop: voxels left through pipe' log
    grep -q '^vkt crop: .*multiply-adds' log # the plan
    vkt read v.nrrd --roi 2:,:,: -v -o part.nrrd 2>log
    grep -qx 'vkt read: region 2:4,0:4,0:4' log
    grep -qx 'vkt read: voxels left through file part.nrrd' log
    head -c 64 /dev/zero >bare
    vkt read bare --dims 4 4 4 --dtype uint8 -v -o bare.nrrd 2>log
    grep -qx 'vkt read: .*bare: format raw, 4 4 4 uint8' log
    vkt flip x v.nrrd --transport shm -v 2>log | vkt flip x -v -o twice.nrrd 2>second
    grep -qx 'vkt flip: voxels left through shared memory' log || grep -q 'voxels go through the pipe' log
    grep -q '^vkt flip: .*: format vkt, 4 4 4 float32' second
    [ -z "$(vkt crop v.nrrd --roi 0:2,:,: -o quiet.nrrd 2>&1)" ]
}

@test "a missing value is named, and so is the word that stands in its place" {
    fails_with 2 "--roi is followed by '-o' instead of its value REGION" vkt crop v.nrrd --roi -o c.nrrd
    fails_with 2 "--sigma is followed by '--boundary'" vkt filter gaussian v.nrrd --sigma --boundary clamp
    fails_with 2 "--output has no value OUT" vkt crop v.nrrd --roi 0:2,:,: -o
    [ ! -e c.nrrd ]
    vkt make constant --dims 2 2 2 --value -3 | vkt stats | grep -q -- '-3' # a negative number is a value
}

@test "after -- all words are arguments" {
    cp v.nrrd ./-v.nrrd
    vkt flip x -o w.nrrd -- -v.nrrd
    vkt flip x v.nrrd | vkt diff - w.nrrd
    vkt info -- v.nrrd | grep -q 'dims *4 4 4'
    fails_with 2 "unexpected argument '--roi'" vkt flip x v.nrrd -- --roi
    fails_with 2 "options stand before --" vkt flip x -- v.nrrd -o z.nrrd
}

@test "words of other tools, pictures and packed files are told what to do" {
    fails_with 2 "did you mean '--dims'" vkt resample --size 4,4,4 v.nrrd -o x.nrrd
    fails_with 2 "pictures are written as .png" vkt flip x v.nrrd -o hd.jpg
    for pair in hist:histogram isosurface:mesh export:write import:read cp:copy; do
        fails_with 2 "did you mean 'vkt ${pair#*:}'" vkt "${pair%:*}" v.nrrd
    done
    head -c 5000 /dev/zero | tr '\0' '\377' | gzip >r.gz
    fails_with 3 "'r.gz', unpacked, has no format" vkt info r.gz
    zip -q r.zip v.nrrd || /usr/bin/python3 -m zipfile -c r.zip v.nrrd
    fails_with 3 "unpack it" vkt info r.zip
}

@test "an argument too many is told where outputs and spaces go" {
    fails_with 2 "an output is said as -o c.nrrd" vkt crop v.nrrd c.nrrd --roi 0:2,:,:
    fails_with 2 "a value with spaces in quotes" vkt flip x v.nrrd a b
    fails_with 2 "stands in quotes" vkt dump v.nrrd a b
}

@test "half-typed options are completed in the hint" {
    fails_with 2 "did you mean '--sigma'?" vkt filter gaussian v.nrrd --sig 2 -o s.nrrd
    fails_with 2 "did you mean '--boundary'?" vkt filter gaussian v.nrrd --sigma 2 --bound clamp -o s.nrrd
}

@test "sizes of pictures are refused by the name of their option" {
    for size in 800,600 800x x 1e3 99999999999999999999; do
        fails_with 2 "--size '$size'" vkt render v.nrrd -o a.png --size "$size"
    done
}

@test "words of other tools lead to the command" {
    fails_with 2 "did you mean 'vkt filter gaussian'?" vkt blur v.nrrd
    fails_with 2 "did you mean 'vkt crop'?" vkt clip v.nrrd
    fails_with 2 "did you mean 'vkt resample'?" vkt resize v.nrrd
    fails_with 2 "did you mean 'vkt stats'?" vkt statistics v.nrrd
    fails_with 2 "did you mean 'vkt crop'?" vkt corp v.nrrd
    fails_with 2 "did you mean 'vkt filter gaussian'?" vkt filter gauss v.nrrd
    fails_with 2 "needs a method before 'v.nrrd'" vkt filter v.nrrd
    # A method's name alone is that method, whatever else the word may mean.
    while read -r ours word; do
        fails_with 2 "did you mean 'vkt ${ours//_/ }'?" vkt $word v.nrrd
        fails_with 2 "did you mean 'vkt ${ours//_/ }'?" vkt help $word
    done <<'END'
filter_gaussian gaussian
filter_sobel sobel
filter_median median
filter_gradient gradient
make_noise noise
filter_gaussian smooth
threshold mask
arith invert
END
    fails_with 2 "did you mean 'vkt filter gaussian'?" vkt filter blur v.nrrd
    fails_with 2 "did you mean 'vkt filter box'?" vkt filter mean v.nrrd
    fails_with 2 "did you mean 'vkt filter sharpen'?" vkt filter unsharp v.nrrd
}

@test "a triple is X,Y,Z for every option that takes numbers" {
    vkt render v.nrrd -ra implicit-iso --iso 2 5 --iso-color 1 0 0 0 0 1 --clip-plane -1 0 0 -5 --size 24 -o a.png
    vkt render v.nrrd -ra implicit-iso --iso 2,5 --iso-color 1,0,0 0,0,1 --clip-plane=-1,0,0,-5 --size 24 -o b.png
    vkt image diff a.png b.png
    vkt render --iso-color 1,0,0 --iso 2 v.nrrd -ra implicit-iso --size 24 -o c.png # the list ends before the file
    fails_with 2 "three numbers are written with commas: --spacing 1,2,3" vkt set --spacing 1 2 3 v.nrrd -o s.nrrd
    fails_with 2 "three numbers are written with commas: --sigma 1,2,3" vkt filter gaussian v.nrrd --sigma 1 2 3 -o s.nrrd
    fails_with 2 "three numbers are written with commas: --radius 1,2,3" vkt filter box v.nrrd --radius 1 2 3 -o s.nrrd
    fails_with 2 "several numbers are written with commas: --size 800,600" vkt render v.nrrd --size 800 600 -o s.png
    fails_with 2 "--sigma: '1,2,': a number is missing after a comma" vkt filter gaussian v.nrrd --sigma 1,2, -o s.nrrd
    fails_with 2 "--dims: '4,4,': a number is missing after a comma" vkt make ramp --dims 4,4, -o s.nrrd
    fails_with 2 "--radius: ',1,1': a number is missing before a comma" vkt filter box v.nrrd --radius ,1,1 -o s.nrrd
    fails_with 2 "--percentiles: '1,50,': a number is missing" vkt stats v.nrrd --percentiles 1,50,
    fails_with 2 "--iso: '2,,5': a number is missing" vkt render v.nrrd --iso 2,,5 -ra implicit-iso -o d.png
}

@test "an argument in the place of another is named as the usage names it, and where it belongs is said" {
    fails_with 2 "AXIS: 'v.nrrd' is not one of x, y, z" vkt flip v.nrrd
    [[ "$stderr" == *"hint: it comes first: vkt flip AXIS IN"* ]]
    fails_with 2 "WHAT: 'v.nrrd' is not one of" vkt project v.nrrd
    [[ "$stderr" == *"hint: it comes first: vkt project WHAT IN"* ]]
    fails_with 2 "WHAT: 'v.nrrd' is not one of" vkt morphology v.nrrd
    [[ "$stderr" == *"hint: it comes first: vkt morphology WHAT IN"* ]]
    fails_with 2 "OP: 'v.nrrd' is not one of" vkt arith v.nrrd
    [[ "$stderr" == *"hint: it comes first: vkt arith OP A B C"* ]]
    # An option keeps its dashes.
    fails_with 2 "--axis: 'w' is not one of x, y, z" vkt project max v.nrrd --axis w
}

@test "a domain's ends and an absolute tolerance are told what they are" {
    fails_with 2 "--domain '7:5': 7 is not below 5" vkt render v.nrrd --domain 7:5 -o a.png
    fails_with 2 "--domain '0-10' is not LO:HI" vkt render v.nrrd --domain 0-10 -o a.png
    [[ "$stderr" != *"domain: domain"* ]]
    fails_with 2 "--tolerance: '1%' is a percentage" vkt diff v.nrrd v.nrrd --tolerance 1%
    [[ "$stderr" == *"it is an absolute value here"* ]]
}

@test "a usage error leaves nothing in a file that standard output goes to" {
    run ! bash -c 'vkt crop v.nrrd --roi x >out.nrrd'
    [ ! -s out.nrrd ]
    run ! bash -c 'vkt crop v.nrrd --roi 0:99,:,: >out.nrrd'
    [ ! -s out.nrrd ]
}

@test "an upstream command is blamed only where there is one" {
    fails_with 3 "is empty" vkt info - </dev/null
    [[ "$stderr" != *upstream* ]]
    run --separate-stderr bash -c 'true | vkt info'
    [ "$status" -eq 3 ]
    [[ "$stderr" == *"is empty"*"the command before it wrote no volume: it failed, or writes none"* ]]
    # It need not have failed.
    run -3 --separate-stderr bash -c 'vkt make noise --dims 8 8 8 | vkt write x.nrrd | vkt stats'
    [[ "$stderr" == *"writes none to standard output"* ]]
    run -3 --separate-stderr bash -c 'true | vkt flip x'
    [[ "$stderr" != *"upstream command failed"* ]]
}

@test "an option means one thing in every command" {
    # --size is how large what is made is: pictures in pixels, bricks in voxels. --tolerance is what an error may be: a
    # share of the range with %, a physical value without, or levels of a display.
    vkt help --list >verbs
    while read -r verb; do
        # shellcheck disable=SC2086
        vkt $verb --help | sed -n '/^Options:/,$s/^ .*--\(unit\|size\|first\|last\|tolerance\)\b\( [^ ]*\( [A-Z]\)*\).*/\1\2/p'
    done <verbs | sed 's/ *$//' | sort -u >found
    diff - found <<'END'
first X Y Z
last X Y Z
size N|X,Y,Z
size WxH
tolerance LEVELS
tolerance P%
tolerance T
tolerance T|P%
unit UNIT
END
    # What lacks its sign is told how it is written.
    vkt make noise --dims 6 5 4 -o n.nrrd
    fails_with 2 "--tolerance 0.01%" vkt filter gaussian n.nrrd --sigma 1 --tolerance 1e-4 -o x.nrrd
    [ "$(vkt resample n.nrrd --dims auto,10,auto | vkt info --json | tr -d ' \n' | grep -o '"dims":[^]]*]')" = '"dims":[12,10,8]' ]
    [ "$(vkt resample n.nrrd --dims auto auto 2 | vkt history | head -1)" = "vkt resample --dims auto auto 2" ]
    for dims in auto,auto,auto 0,auto,auto 4,-1,auto 4,4 4,x,auto; do
        fails_with 2 "--dims" vkt resample n.nrrd --dims $dims -o x.nrrd
    done
}

@test "messages have levels: errors always, notes unless quiet, details if verbose" {
    vkt make ramp --dims 300 2 2 -o r.nrrd
    run -0 --separate-stderr vkt convert r.nrrd --dtype uint8 -o a.nrrd
    [[ "$stderr" == "vkt convert: "*clipped* ]]
    run -0 --separate-stderr vkt convert r.nrrd --dtype uint8 -o b.nrrd --quiet
    [ -z "$stderr" ]
    run -0 --separate-stderr vkt convert r.nrrd --dtype uint8 -o c.nrrd --verbose
    [[ "$stderr" == *clipped* && "$stderr" == *"format nrrd"* ]]
    for level in --quiet --verbose; do fails_with 4 "the file exists" vkt convert r.nrrd --dtype uint8 -o a.nrrd $level; done
    # What was asked for is told at any level.
    vkt convert r.nrrd --dtype uint8 -o d.nrrd --quiet -n 2>&1 | grep -q 'peak memory'
    # Nobody listens: the work is done all the same.
    vkt convert r.nrrd --dtype uint8 -o e.nrrd 2>&-
    vkt diff a.nrrd e.nrrd
}

@test "a region that is none is named by its option and as a whole" {
    vkt make ramp --dims 20 4 4 -o r.nrrd
    for verb in "crop" "read" "stats" "fill --value 1"; do
        # shellcheck disable=SC2086
        fails_with 2 "--roi '0-10,:,:': '0-10' is not an integer" vkt $verb r.nrrd --roi 0-10,:,:
    done
    fails_with 2 "--roi '0:200%,:,:': '200%' is not between 0% and 100%" vkt crop r.nrrd --roi 0:200%,:,:
    fails_with 2 "--roi-world '0:a,:,:': 'a' is not a number" vkt crop r.nrrd --roi-world 0:a,:,:
}

@test "values that other tools call otherwise, or write in capitals, lead to ours" {
    vkt make ramp --dims 4 3 2 -o r.nrrd
    while read -r ours words; do
        # shellcheck disable=SC2086
        fails_with 2 "did you mean '$ours'?" vkt $words
    done <<'END'
mirror filter box r.nrrd --boundary reflect
clamp pad r.nrrd --by 1 --boundary edge
wrap pad r.nrrd --by 1 --boundary Wrap
add arith + r.nrrd 1
mean project average r.nrrd
max project MAX r.nrrd
END
    # Letters that have nothing in common are no suggestion.
    run -2 --separate-stderr vkt project max r.nrrd --axis 2
    [[ "$stderr" != *"did you mean"* ]]
}

@test "what is spelt as a number and is none is no file name; a result that cannot be is the option's fault" {
    vkt make ramp --dims 4 3 2 -o r.nrrd
    fails_with 2 "'1e999' is out of range" vkt arith add r.nrrd 1e999
    fails_with 2 "'nan' is not a number" vkt arith where r.nrrd r.nrrd nan
    fails_with 2 "'nan' is not a number" vkt affine 'nan 0 0 0 0 1 0 0 0 0 1 0' r.nrrd
    vkt make constant --dims 4 3 2 --value 1 --format nrrd -o nan
    vkt arith add r.nrrd ./nan | vkt diff - <(vkt arith add r.nrrd 1)
    fails_with 2 "exceed 2^62 bytes" vkt pad r.nrrd --by 9999999
    fails_with 2 "--csv and --json" vkt stats r.nrrd --csv --json
}

@test "the name of a report's file says its form, or is refused before anything is read" {
    vkt make constant --dims 3 4 5 --value 1 -o m.nrrd
    for command in 'label m.nrrd' 'watershed m.nrrd' 'fill-holes m.nrrd' 'threshold m.nrrd --above 0'; do
        # shellcheck disable=SC2086
        for name in r r.json r.JSON; do vkt $command --report $name | vkt stats >/dev/null; done
        cmp r r.json
        cmp r r.JSON
        for name in r.xml r.png r.csv.bak; do
            # shellcheck disable=SC2086
            fails_with 2 "--report $name: reports of that kind are not written" vkt $command --report $name -o out.nrrd
            # shellcheck disable=SC2086
            fails_with 2 "end the name in .json, .csv or .txt" vkt $command --report $name -n -o out.nrrd
            [ ! -e out.nrrd ]
            [ ! -e $name ]
        done
        rm r r.json r.JSON
    done
    vkt label m.nrrd --report l.csv -o l.nrrd
    /usr/bin/python3 -c '
import csv
row, = csv.DictReader(open("l.csv"))
assert row["components"] == row["label"] == "1" and row["size"] == "60" and row["upper_z"] == "5", row'
    vkt label m.nrrd --report l.txt -o l.nrrd --force
    grep -qx "components  *1" l.txt
    vkt stack m.nrrd m.nrrd -o s.nrrd
    vkt label s.nrrd --report s.csv -o l.nrrd --force
    [ "$(wc -l <s.csv)" -eq 3 ]
}

@test "--report goes where no result does, and is one JSON also where it cannot be replaced" {
    vkt make checkerboard --dims 6 5 4 --dtype uint8 -o m.nrrd
    for file in - /dev/stdout; do
        fails_with 2 "--report $file names where the result goes" vkt label m.nrrd --report $file
    done
    fails_with 2 "names where the result goes" vkt label m.nrrd --report l.nrrd -o ./l.nrrd
    fails_with 2 "names where the result goes" vkt pipe 'read m.nrrd | label --report - | stats'
    [ ! -e l.nrrd ]
    vkt stack m.nrrd m.nrrd -o s.nrrd
    vkt label s.nrrd --report file.json -o a.nrrd
    vkt label s.nrrd --report - -o b.nrrd >printed.json
    mkfifo pipe
    cat pipe >piped.json &
    reader=$!
    vkt label s.nrrd --report pipe | cat >c.vkt
    wait $reader
    for got in printed piped; do cmp file.json $got.json; done
    [ "$(grep -c components file.json)" -eq 2 ]
}

@test "an expression may begin with a minus" {
    vkt make ramp --dims 4 3 2 -o r.nrrd
    vkt arith neg r.nrrd -o n.nrrd
    for words in '-v*1' '-(v)' '-v[0,0,0]' '-1 * v'; do vkt transform "$words" r.nrrd | vkt diff - n.nrrd; done
    vkt pipe "read r.nrrd | transform '-v * 1'" | vkt diff - n.nrrd
    fails_with 2 "arguments that begin with - stand behind --" vkt transform -x r.nrrd
    vkt transform -- -x r.nrrd | vkt diff - <(vkt transform 0-x r.nrrd)
}

@test "GPUs are numbered, or all of them are named" {
    vkt make noise --dims 4 4 4 -o a.nrrd
    run --separate-stderr vkt flip x a.nrrd --device cpu:all
    [ "$status" -eq 2 ]
    [[ $stderr == *"--device: 'cpu:all': only GPUs are numbered"*"or gpu:all"* ]]
    VKT_DEVICE=gpu:many run --separate-stderr vkt flip x a.nrrd
    [ "$status" -eq 2 ]
    [[ $stderr == *"VKT_DEVICE: 'many' is not an integer"* ]]
    # Of a machine without one that is said, whatever was asked for.
    if vkt doctor --json | grep -q '"GPUs": "none'; then
        run --separate-stderr vkt flip x a.nrrd --device gpu:all
        [ "$status" -eq 5 ]
        [[ $stderr == *GPU* || $stderr == *CUDA* ]]
    fi
}

@test "IN OUT is IN -o OUT where a file becomes a file; an option of reading or writing is said where it is taken" {
    vkt make ramp --dims 4 3 2 --dtype uint8 -o r.nrrd
    vkt edit r.nrrd e.nrrd --units HU
    vkt info e.nrrd --json | grep -q '"units": "HU"'
    vkt set r.nrrd --attribute space=LPS | vkt reorient --to RAS - ras.nrrd
    vkt diff ras.nrrd <(vkt set r.nrrd --attribute space=LPS | vkt permute --to RAS) --geometry
    vkt reorient zyx r.nrrd turned.nrrd
    vkt diff turned.nrrd <(vkt permute zyx r.nrrd)
    fails_with 2 "vkt read takes it: vkt read FILE --variable … | vkt convert" vkt convert r.nrrd --variable a
    fails_with 2 "vkt read takes it: vkt read FILE --force-uniform … | vkt stats" vkt stats r.nrrd --force-uniform
    fails_with 2 "vkt write takes it: vkt filter gaussian … | vkt write FILE --pyramid" vkt filter gaussian r.nrrd --sigma 1 --pyramid
    fails_with 2 "see 'vkt stats --help'" vkt stats r.nrrd --unheard-of
}

@test "flags take no value, and an option said with an empty one takes no word of others" {
    cp v.nrrd kept.nrrd
    for value in no false 0 maybe; do
        fails_with 2 "--force takes no value" vkt flip x v.nrrd -o kept.nrrd --force=$value
    done
    cmp v.nrrd kept.nrrd
    fails_with 2 "--strict takes no value" vkt pipe 'read v.nrrd | flip x --strict=no | stats'
    fails_with 2 "no region given" vkt crop v.nrrd --roi= -o c.nrrd
    fails_with 2 "--sigma: '' is not a number" vkt filter gaussian v.nrrd --sigma= -o c.nrrd
    fails_with 2 "--value: " vkt fill --value= v.nrrd -o c.nrrd
    [ ! -e c.nrrd ]
}

@test "what is half typed, or has another name elsewhere, finds its option and its command" {
    fails_with 2 "did you mean '--elevation'?" vkt render v.nrrd --elev 3 -o x.png
    fails_with 2 "did you mean '--percentiles'?" vkt stats v.nrrd --perc 1
    fails_with 2 "did you mean '--json'?" vkt stats v.nrrd --js
    for pair in dilate:morphology erode:morphology close:morphology sum:stats histo:histogram segment:threshold; do
        fails_with 2 "did you mean 'vkt ${pair#*:}'?" vkt ${pair%:*} v.nrrd
    done
}

@test "a file that ends with the error of who wrote it says so" {
    vkt make ramp --dims 300 1 1 --dtype int16 -o r.vkt
    run -3 vkt convert r.vkt --dtype uint8 --strict >/dev/null
    vkt convert r.vkt --dtype uint8 --strict >failed.vkt 2>/dev/null || true
    [ -s failed.vkt ]
    fails_with 3 "failed.vkt ends with the error of the command that wrote it: vkt convert: --strict: 44 of 300 voxels" vkt stats failed.vkt
    fails_with 3 "ends with the error of the command that wrote it" vkt pipe 'read failed.vkt | flip x | stats'
    head -c 300 r.vkt >cut.vkt
    fails_with 3 "the file was cut off, or the command that wrote it failed" vkt stats cut.vkt
}
