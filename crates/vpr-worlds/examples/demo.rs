//! x
fn main(){
 let a:Vec<String>=std::env::args().collect();
 let text=std::fs::read_to_string(&a[1]).unwrap();
 let r=match vpr_worlds::Recipe::parse(&text,std::path::Path::new(&a[1])){Ok(r)=>r,Err(e)=>{eprintln!("{e}");return}};
 let n=r.places; let picks:Vec<(bool,usize)>=if a.len()>4{ (0..a[4].parse::<usize>().unwrap()).map(|k|(false,k)).collect()} else {(0..12).map(|k|(k%2==1,(k/2)*n/6+3)).collect()};
 let im=vpr_worlds::demo(&r,&picks);
 let cols=a[3].parse::<u32>().unwrap(); let (w,h)=im[0].dimensions(); let show=&im[..im.len().min(12)]; let rows=(show.len() as u32).div_ceil(cols);
 let mut s=image::RgbImage::new(cols*(w+4),rows*(h+4));
 for (k,i) in show.iter().enumerate(){image::imageops::replace(&mut s,i,i64::from((k as u32%cols)*(w+4)),i64::from((k as u32/cols)*(h+4)));}
 s.save(&a[2]).unwrap();
}
