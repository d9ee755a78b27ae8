# Other users of the machine: they get no voxels, and what they plant is not followed.
load ../helper

setup_more() { vkt make noise --seed 2 --dims 64 61 67 --dtype uint16 -o in.nrrd; }

# As another user, at the abstract socket through which two stages would meet: `listen` where the producer would,
# `connect` to it before the consumer does. Prints what it received; the pipeline must give the same either way.
stranger() {
    cat >stranger.py <<'PY'
import os, socket, struct, subprocess, sys, time
way = sys.argv[1]
r, w = os.pipe()
inode = os.fstat(w)
name = "\0vkt-%d-%d-%d" % (os.getuid(), inode.st_dev, inode.st_ino)
ready, told = os.pipe()
child = os.fork()
if child == 0:
    os.close(r); os.close(w)
    os.setgid(65534); os.setuid(65534)
    s = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    s.settimeout(10)
    if way == "listen":
        s.bind(name); s.listen(4)
        os.write(told, b"x")
        c, _ = s.accept()
    else:
        os.write(told, b"x")
        for i in range(500):
            try:
                s.connect(name); break
            except OSError:
                time.sleep(0.01)
        c = s
        try:
            c.send(struct.pack("I", 0x314b5456))
        except BrokenPipeError: # hung up already
            pass
    c.settimeout(10)
    try:
        data, descriptors, _, _ = socket.recv_fds(c, 64, 4)
    except ConnectionResetError:
        data, descriptors = b"", []
    print("stranger: met, %d bytes, %d descriptors" % (len(data), len(descriptors)), file=sys.stderr)
    os._exit(0 if not data and not descriptors else 1)
os.read(ready, 1)
environment = dict(os.environ, VKT_TRANSPORT="shm")
producer = subprocess.Popen(["vkt", "flip", "x", "in.nrrd"], stdout=w, env=environment)
os.close(w)
if way == "connect": time.sleep(1)
consumer = subprocess.run(["vkt", "flip", "x", "-o", "out.nrrd", "--force"], stdin=r, env=environment)
os.close(r)
assert producer.wait() == 0 and consumer.returncode == 0
assert os.waitpid(child, 0)[1] == 0
PY
    timeout 60 /usr/bin/python3 stranger.py "$1"
}

@test "whoever sits at the meeting place of two stages gets nothing, and the voxels arrive" {
    [ "$(id -u)" -eq 0 ] || skip "only root can act as another user"
    /usr/bin/python3 -c 'import socket; socket.recv_fds' 2>/dev/null || skip "python3 is too old"
    for way in listen connect; do
        stranger $way 2>err || { cat err >&2; false; }
        grep -q 'stranger: met, 0 bytes, 0 descriptors' err || { cat err >&2; false; }
        vkt diff in.nrrd out.nrrd
    done
}

@test "shared memory and spools have no name" {
    names_in_shm >before
    mkfifo pipe
    mkdir spool
    vkt read in.nrrd >whole.vkt
    # The flip along z spools its input and waits for the rest of it.
    TMPDIR=$PWD/spool timeout 60 vkt flip z pipe -o out.nrrd --force --memory 50k 2>/dev/null 3>&- &
    exec 9>pipe
    head -c 300000 whole.vkt >&9
    found=no
    for _ in $(seq 100); do
        stage=$(pgrep -n -f 'vkt flip z pipe -o out.nrrd') || { sleep 0.05; continue; }
        if ls -l "/proc/$stage/fd" 2>/dev/null | grep -q 'spool/.*(deleted)'; then found=yes && break; fi
        sleep 0.05
    done
    left=$(ls -A spool)
    tail -c +300001 whole.vkt >&9
    exec 9>&-
    wait
    [ $found = yes ]
    [ -z "$left" ]
    vkt flip z in.nrrd | vkt diff - out.nrrd
    vkt read in.nrrd --transport shm | vkt flip x --transport shm | vkt stats >/dev/null
    # Run times of OpenMP register there and leave again.
    names_in_shm >after
    comm -13 before after | grep vkt >left || true
    [ ! -s left ]
}

@test "a link that somebody else planted where all may write is not followed" {
    [ "$(id -u)" -eq 0 ] || skip "only root can act as another user"
    mkdir shared
    chmod 1777 shared
    echo precious >victim
    ln -s ../victim shared/out.nrrd
    chown -h 65534 shared/out.nrrd
    for force in '' --force; do
        # shellcheck disable=SC2086
        run vkt flip x in.nrrd -o shared/out.nrrd $force
        [ "$status" -eq 4 ]
        [ "$(cat victim)" = precious ]
    done
    # One's own link is meant: it stays, and what it leads to is replaced, if that was allowed.
    chown -h 0 shared/out.nrrd
    run vkt flip x in.nrrd -o shared/out.nrrd
    [ "$status" -eq 4 ]
    [ "$(cat victim)" = precious ]
    vkt flip x in.nrrd -o shared/out.nrrd --force
    [ -L shared/out.nrrd ]
    mv victim victim.nrrd
    vkt flip x victim.nrrd | vkt diff - in.nrrd
}
