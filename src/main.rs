use signorini::*;
fn main(){
  let a: Vec<String>=std::env::args().collect();
  let ks: Vec<usize>=a[1].split(',').map(|s|s.parse().unwrap()).collect();
  let verbose=a.get(2).is_some();
  for &k in &ks { 
  for g in [3e6,6e6,1e7,1.5e7,2e7,3e7,5e7] { let geo=reference::Geometry::OneBody; let name=format!("g={g:e}"); let loads=reference::Loads{tresca:g,..reference::TABLE1};
  let mesh=reference::mesh(geo,k);
  let p=reference::problem(geo,&mesh,&loads).unwrap();
  let mut d=stiffness::cholesky::CholeskyDual::new(&p).unwrap();
  print!("k={k} {name}");
  for eps in [1e-4] { for beta in [0.05,1.0,1.9,20.0,100.0] { if verbose {println!("eps {eps} beta {beta}");}
    let s=ssnm::solve(&p,&mut d,&ssnm::Settings{tolerance:eps,beta,..Default::default()},|s| {if verbose {println!("{s:?}");} std::ops::ControlFlow::Continue(())});
    print!(" {:2}/{:3} ({:2}/{:3}){}",s.info.iter,s.info.n_a,s.info.first_met.unwrap_or((0,0)).0,s.info.first_met.unwrap_or((0,0)).1,if s.status==ssnm::Status::Converged {"".into()} else {format!("{:?}{:.0e}",s.status,s.info.kkt.max())}); } print!("  |");}
  println!();
  }}
}
