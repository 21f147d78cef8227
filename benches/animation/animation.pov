// The assignment's animation for POV-Ray 3.7: same camera, objects, light and one reflection of weight 0.25; clock is t.
#version 3.7;
global_settings { assumed_gamma 1.0 max_trace_level 2 ambient_light rgb 1 }
#declare P = <0,300,200> + clock*<0,200,-100>;
#declare T = <-100,-300,1216>;
#declare W = vnormalize(P - T);
#declare U = vnormalize(vcross(y, W));
#declare V = vcross(W, U);
camera { perspective location P direction -1000*W right 1024*U up 1024*V }
light_source { <-400,100,850> rgb 1 }
background { rgb 0 }
#macro M(R,G,B,KD,KS)
  texture { pigment { rgb <R,G,B>/255 } finish { ambient 1.1 diffuse KD phong KS phong_size 16 reflection 0.25 } }
#end
// About the vertical axis through TP; POV-Ray's y rotation turns z towards x in its left-handed view as ours does in numbers.
#declare A = <-100,0,1216>;
sphere { <-500,-425,1200> - A, 75 rotate y*360*clock translate A M(124,10,2,1,4) }
sphere { <300,-400,1350> - A, 100 rotate -y*360*clock translate A M(25,25,112,1,3) }
triangle { <-10000,-500,-10000>, <-10000,-500,100000>, <10000,-500,-10000> M(156,181,203,0.2,0.2) }
#declare TP=<-100,-200,1216>; #declare B1=<0,-600,1250>; #declare B2=<-100,-600,1150>; #declare B3=<-200,-600,1250>;
mesh { triangle{B1,B2,B3} triangle{B1,B2,TP} triangle{B2,B3,TP} triangle{B1,B3,TP} M(128,0,128,1,2) }
