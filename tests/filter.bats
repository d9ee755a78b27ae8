# vkt filter: the methods and what happens without one. The methods have files of their own.
load helper

@test "lists its methods" {
    vkt filter --help | grep -q '^  gaussian '
    for method in $(vkt filter --help | sed -n '/^Methods:/,$s/^  \([a-z-]*\) .*/\1/p'); do
        vkt filter "$method" --help | grep -q "^vkt filter $method:"
        [ -e "$VKT_ROOT/tests/filter-$method.bats" ]
    done
}

@test "a method is needed, a wrong one is corrected" {
    fails_with 2 'gaussian' vkt filter
    fails_with 2 "gaussian" vkt filter gausian --sigma 2
}
