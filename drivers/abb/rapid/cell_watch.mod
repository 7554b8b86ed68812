MODULE cell_watch
    ! Stops the motion when the calibration cell falls silent: cable cut, computer hung or dead.
    ! A background task (cell_watch.cfg) that moves nothing. While a motion of the cell runs, the
    ! cell counts cell_watch_beat up over Robot Web Services; 0 means that nobody is to be watched.

    PERS num cell_watch_beat := 0;      ! written by the cell
    PERS num cell_watch_limit := 0.6;   ! written by the cell: longest silence, seconds
    PERS num cell_watch_turn := 0;      ! counted here: tells the cell that this task runs
    PERS num cell_watch_stops := 0;     ! counted here: how often the motion was stopped

    PROC cell_watch_main()
        VAR num heard := 0;
        VAR clock silence;

        cell_watch_beat := 0;
        WHILE TRUE DO
            cell_watch_turn := (cell_watch_turn + 1) MOD 10000;
            IF cell_watch_beat <> heard THEN
                heard := cell_watch_beat;
                ClkReset silence;
                ClkStart silence;
            ENDIF
            IF heard <> 0 AND ClkRead(silence) > cell_watch_limit THEN
                ! all motion tasks; their program pointers must be moved before they run again, so
                ! that no start button drives on
                SystemStopAction \StopBlock;
                cell_watch_beat := 0;
                heard := 0;
                cell_watch_stops := cell_watch_stops + 1;
                ErrWrite "Calibration cell silent", "The motion was stopped: the calibration cell fell silent.";
            ENDIF
            WaitTime 0.02;
        ENDWHILE
    ENDPROC
ENDMODULE
