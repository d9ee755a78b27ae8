# fish completion of vkt: the command itself knows its verbs, options and values.
# SPDX-License-Identifier: MIT
function __vkt_candidates
    set -l words (commandline -opc) (commandline -ct)
    vkt completion --words $words[2..-1] 2>/dev/null
end
function __vkt_has_candidates
    count (__vkt_candidates) >/dev/null
end
complete -c vkt -n __vkt_has_candidates -f -a '(__vkt_candidates)'
