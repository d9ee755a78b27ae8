# bash completion of vkt: the command itself knows its verbs, options and values.
# SPDX-License-Identifier: MIT
_vkt() {
    local IFS=$'\n' current="${COMP_WORDS[COMP_CWORD]}" before=$((COMP_CWORD - 1)) cut=
    # bash splits "--option=value" at the equals sign; vkt sees the words before the one under the cursor, then that one.
    # "shm:NAME" is three words to bash, and what it replaces begins behind the colon.
    if [ "$current" = : ] && [ "${COMP_WORDS[COMP_CWORD-1]}" = shm ]; then
        current=shm: before=$((COMP_CWORD - 2)) cut=shm:
    elif [ "$COMP_CWORD" -gt 2 ] && [ "${COMP_WORDS[COMP_CWORD-2]}${COMP_WORDS[COMP_CWORD-1]}" = shm: ]; then
        current=shm:$current before=$((COMP_CWORD - 3)) cut=shm:
    fi
    mapfile -t COMPREPLY < <(vkt completion --words "${COMP_WORDS[@]:1:before}" "$current" 2>/dev/null)
    COMPREPLY=("${COMPREPLY[@]#"$cut"}")
    if [ ${#COMPREPLY[@]} -eq 0 ]; then
        compopt -o filenames 2>/dev/null
        mapfile -t COMPREPLY < <(compgen -f -- "$current")
    elif [ ${#COMPREPLY[@]} -eq 1 ] && [[ ${COMPREPLY[0]} == *= ]]; then
        compopt -o nospace 2>/dev/null
    fi
}
complete -F _vkt vkt
