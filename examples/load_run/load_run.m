% Loads runs that abs_report --octave exported and repeats their main figures, in Octave or MATLAB.
% usage: octave --quiet load_run.m RUNS.mat        (in MATLAB: set `file` and run the lines below it)
file = argv(){1};
data = load(file);
end_speed_m_s = 0.3;   % experiment.end_speed_m_s
r2_m = 0.099;          % plant.r2_m, radius of the lower wheel
for k = 1:numel(data.runs)
  run = data.runs(k);
  braking = run.phase == find(strcmp(run.phase_names, 'brake'));
  start_s = run.time_s(find(braking, 1));
  v_x_m_s = r2_m * run.omega2_rad_s;
  stopped = find(run.time_s > start_s & v_x_m_s < end_speed_m_s, 1);
  judged = braking & run.time_s > start_s + 0.3 & v_x_m_s > 3;
  slip_rms = sqrt(mean((run.slip(judged) - run.slip_ref(judged)).^2));
  printf('%s (%s): stop time %.3f s, distance %.3f m, slip RMS error %.5f\n', run.name, run.controller, ...
         run.time_s(stopped) - start_s, run.distance_m(stopped), slip_rms);
  % plot(run.time_s - start_s, run.slip); xlabel('time since the start of braking / s'); ylabel('slip');
end
