# bash completion of vkt: the command itself knows its verbs, options and values.
# SPDX-License-Identifier: MIT
_vkt() {
    local IFS=$'\n' current="${COMP_WORDS[COMP_CWORD]}"
    # bash splits "--option=value" at the equals sign; vkt sees the words before the one under the cursor, then that one.
    mapfile -t COMPREPLY < <(vkt completion --words "${COMP_WORDS[@]:1:COMP_CWORD-1}" "$current" 2>/dev/null)
    if [ ${#COMPREPLY[@]} -eq 0 ]; then
        compopt -o filenames 2>/dev/null
        mapfile -t COMPREPLY < <(compgen -f -- "$current")
    elif [ ${#COMPREPLY[@]} -eq 1 ] && [[ ${COMPREPLY[0]} == *= ]]; then
        compopt -o nospace 2>/dev/null
    fi
}
complete -F _vkt vkt
