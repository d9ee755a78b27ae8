# How tests are counted where their time ended before they did (tests/tally.sh).
load helper

@test "what the end of the time cut short or kept from beginning is skipped and said, what failed before has failed" {
    cat >log <<'EOF'
1/7 Test #1: Some.Test ............   Passed    1.01 sec
2/7 Test #2: bats/one.bats ........***Failed    2.00 sec
3/7 Test #3: bats/two.bats ........***Timeout 900.25 sec
4/7 Test #4: bats/hung.bats .......***Timeout 1200.01 sec
5/7 Test #5: Other.Test ...........***Timeout   3.10 sec
EOF
    printf '%s\n' 'ok 1 good' 'not ok 2 bad' 'ok 3 absent # skip no sample' >last
    sh "$VKT_ROOT/tests/tally.sh" log last late >counts
    # Some.Test and good; bad; the sample's, two files that were cut, two that were not begun.
    head -n 1 counts | grep -x '2 1 5'
    grep -q 'no time left for all of .*two.bats' counts
    grep -q 'no time left to begin 2 of 7 tests' counts
    run ! grep hung counts
    # Without an end of the time they would have failed.
    sh "$VKT_ROOT/tests/tally.sh" log last >counts
    head -n 1 counts | grep -x '2 2 1'
}
