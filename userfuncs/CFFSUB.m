% CFFSUB in the MATLAB language, run by GNU Octave: the law of coulomb_stribeck.py.
%
% Run:  script_name="CFFSUB.m" interpreter="MATLAB" in the deck, or --plugin CFFSUB.m
%
% cff_param_string = "USER(mu_static, mu_dynamic, stiction_velocity, friction_velocity)"
%
% The file has the name of its function (cff_fnc_name). par, loci, locj, x and xdot are rows.
function vector = CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag)
  mu_static = par(1);
  mu_dynamic = par(2);
  vs = par(3);
  vd = par(4);

  v = hypot(xdot(1), xdot(2));

  % ratio is mu / v; below vs the STEP from (-vs, -mu_static) to (vs, mu_static), divided by v
  % on paper: nothing is divided by v where v may be 0
  if v <= vs
    u = v / vs;
    ratio = 0.5 * mu_static * (3.0 - u * u) / vs;
  elseif v < vd
    u = (v - vs) / (vd - vs);
    ratio = (mu_static + (mu_dynamic - mu_static) * u * u * (3.0 - 2.0 * u)) / v;
  else
    ratio = mu_dynamic / v;
  end

  vector = [-ratio * nforce * xdot(1), -ratio * nforce * xdot(2), 0.0];
end
